//! Routes, wire types, problems and the OpenAPI document: the only room that names axum.
