#![no_main]

use chladni_mesh::read::MeshFormat;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| chladni_fuzz::answer(bytes, MeshFormat::Gltf));
