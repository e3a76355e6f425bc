//! Jobs, meshes, bases and blobs in SQL: the only room that names sqlx.
