//! Compiles the one file of C: how METIS reports errors.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=src/metis_errors.c");
    // Elsewhere there is no SIGTERM to be kept from METIS.
    if std::env::var_os("CARGO_CFG_UNIX").is_some() {
        cc::Build::new().file("src/metis_errors.c").warnings(true).compile("chladni_metis_errors");
    }
}
