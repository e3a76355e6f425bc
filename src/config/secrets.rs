//! Settings that never show: API keys, and addresses that may hold a password.

/// API keys as they were configured, `NAME:SCOPES:SECRET` each. They never show in debug output or in a help text.
#[derive(Clone, PartialEq, Eq, Default)]
pub struct Keys(Vec<String>);

impl Keys {
    /// The entries, in the order in which they were given.
    pub fn entries(&self) -> &[String] {
        &self.0
    }
}

impl Extend<String> for Keys {
    fn extend<I: IntoIterator<Item = String>>(&mut self, entries: I) {
        self.0.extend(entries);
    }
}

impl std::str::FromStr for Keys {
    type Err = std::convert::Infallible;
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        Ok(Self(text.split(',').map(str::trim).filter(|entry| !entry.is_empty()).map(String::from).collect()))
    }
}

impl std::fmt::Debug for Keys {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Keys({} hidden)", self.0.len())
    }
}

/// A setting that may hold a password. It never shows in debug output or in a help text.
#[derive(Clone, PartialEq, Eq)]
pub struct Secret(String);

impl Secret {
    /// What it says.
    pub fn reveal(&self) -> &str {
        &self.0
    }
}

impl std::str::FromStr for Secret {
    type Err = std::convert::Infallible;
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        Ok(Self(text.to_owned()))
    }
}

impl std::fmt::Debug for Secret {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Secret(hidden)")
    }
}
