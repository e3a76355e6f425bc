//! Reading meshes from untrusted bytes: one file per format.
