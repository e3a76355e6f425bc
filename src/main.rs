#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

unsafe extern "C" {
    /// Of mimalloc: gives back what it keeps, of all threads as far as they let go of whole pages.
    safe fn mi_collect(force: bool);
}

fn main() -> std::process::ExitCode {
    chladni_base::set_trim(trim);
    chladni::cli::main()
}

/// By itself the allocator keeps what was let go of for a second and more, and many gigabytes pass by in one: without
/// this the join of four parts of 8.6 million vertices takes 3.56 GB, and 2.75 with it (docs/decisions/0132).
fn trim() {
    mi_collect(true);
}
