#![no_main]

use chladni::mesh::read::MeshFormat;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| chladni_fuzz::answer(bytes, MeshFormat::Obj));
