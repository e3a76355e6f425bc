#![no_main]

libfuzzer_sys::fuzz_target!(
    init: {
        // With this set, inputs to begin with are written there, and nothing is run.
        if let Some(folder) = std::env::var_os("CHLADNI_FUZZ_SEEDS") {
            for (name, input) in chladni_fuzz::seeds() {
                std::fs::write(std::path::Path::new(&folder).join(name), input).expect("a seed can be written");
            }
            std::process::exit(0);
        }
    },
    |bytes: &[u8]| {
        chladni_fuzz::send_body(bytes);
    }
);
