#![no_main]

libfuzzer_sys::fuzz_target!(
    init: {
        // With this set, inputs to begin with are written, and nothing is run.
        if let Some(folder) = std::env::var_os("CHLADNI_FUZZ_SEEDS") {
            chladni_fuzz::write_seeds(folder.into());
            std::process::exit(0);
        }
    },
    |bytes: &[u8]| chladni_fuzz::send_body(bytes)
);
