//! The client of the tests speaks no TLS, but is built with it where the program has it, and asks for its cryptography
//! then.

/// A client as it comes.
pub fn client() -> reqwest::Client {
    builder().build().expect("a client can be built")
}

/// A client that is to be set up.
pub fn builder() -> reqwest::ClientBuilder {
    #[cfg(feature = "cluster")]
    {
        // Only the first time does something.
        let _ = rustls::crypto::ring::default_provider().install_default();
    }
    reqwest::Client::builder()
}
