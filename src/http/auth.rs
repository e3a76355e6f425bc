//! API keys: bearer tokens, hashed at rest, with scopes.

use std::net::SocketAddr;
use std::str::FromStr;

/// What a key may do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Scope {
    /// Read everything and evaluate stored bases.
    Read,
    /// Upload meshes; submit, cancel and retry jobs.
    Submit,
    /// Delete things and read the metrics.
    Operate,
}

impl Scope {
    /// The name in configuration and problems.
    pub fn name(self) -> &'static str {
        match self {
            Self::Read => "read",
            Self::Submit => "submit",
            Self::Operate => "operate",
        }
    }

    /// The scope of a name.
    pub fn named(name: &str) -> Option<Self> {
        [Self::Read, Self::Submit, Self::Operate].into_iter().find(|scope| scope.name() == name)
    }
}

/// Why a key in the configuration is refused. No variant shows the secret.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum KeyError {
    /// Not `name:scopes:secret`.
    #[error("an API key must have the form name:scope+scope:secret")]
    Shape,
    /// A scope that does not exist.
    #[error("API key {name:?} has the unknown scope {scope:?}; scopes are read, submit and operate")]
    Scope {
        /// The name of the key.
        name: String,
        /// The unknown scope.
        scope: String,
    },
    /// A secret that can be guessed.
    #[error("API key {name:?} is shorter than {} characters", ApiKey::SHORTEST_SECRET)]
    Short {
        /// The name of the key.
        name: String,
    },
    /// `blake3:` followed by something that is not 64 hexadecimal digits.
    #[error("API key {name:?} has a malformed hash; after blake3: come 64 hexadecimal digits")]
    Hash {
        /// The name of the key.
        name: String,
    },
}

/// A key, kept as the BLAKE3 hash of its secret. Secrets are long and random, so that a fast hash is enough.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ApiKey {
    /// The name, for logs.
    pub name: String,
    /// What the key may do.
    pub scopes: Vec<Scope>,
    hash: blake3::Hash,
}

impl ApiKey {
    /// The fewest characters of a secret.
    pub const SHORTEST_SECRET: usize = 20;

    /// Whether `token` is the secret of this key, in time that does not depend on the token's content.
    pub fn opens(&self, token: &str) -> bool {
        // `blake3::Hash` compares in constant time.
        self.hash == blake3::hash(token.as_bytes())
    }

    /// Whether the key has a scope.
    pub fn allows(&self, scope: Scope) -> bool {
        self.scopes.contains(&scope)
    }
}

impl FromStr for ApiKey {
    type Err = KeyError;

    /// Reads `name:scope+scope:secret` or `name:scope+scope:blake3:HASH` with the hash of the secret in hexadecimal.
    fn from_str(text: &str) -> Result<Self, KeyError> {
        let mut parts = text.trim().splitn(3, ':');
        let (Some(name), Some(scopes), Some(secret)) = (parts.next(), parts.next(), parts.next()) else {
            return Err(KeyError::Shape);
        };
        if name.is_empty() || scopes.is_empty() {
            return Err(KeyError::Shape);
        }
        let name = name.to_owned();
        let scopes = scopes
            .split('+')
            .map(|scope| {
                let scope = scope.trim();
                let unknown = || KeyError::Scope { name: name.clone(), scope: scope.to_owned() };
                Scope::named(scope).ok_or_else(unknown)
            })
            .collect::<Result<Vec<_>, _>>()?;
        let hash = match secret.strip_prefix("blake3:") {
            Some(hex) => blake3::Hash::from_hex(hex).map_err(|_| KeyError::Hash { name: name.clone() })?,
            None if secret.chars().count() < Self::SHORTEST_SECRET => return Err(KeyError::Short { name }),
            None => blake3::hash(secret.as_bytes()),
        };
        Ok(Self { name, scopes, hash })
    }
}

/// A server that others can reach would run without keys.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{address} can be reached from other machines: configure API keys, or pass --insecure to serve without")]
pub struct KeysNeeded {
    /// Where the server would listen.
    pub address: SocketAddr,
}

/// Refuses to listen beyond loopback without keys, unless told to.
///
/// # Errors
/// [`KeysNeeded`] where `address` is not a loopback address, there are no keys and `insecure` is false.
pub fn require_keys(address: SocketAddr, keys: &[ApiKey], insecure: bool) -> Result<(), KeysNeeded> {
    // An IPv4 loopback address may be written as IPv6.
    let loopback = address.ip().to_canonical().is_loopback();
    if loopback || insecure || !keys.is_empty() { Ok(()) } else { Err(KeysNeeded { address }) }
}

/// The key that a token opens. Every key is tried, so that the time does not tell which one matched.
pub fn find<'k>(keys: &'k [ApiKey], token: &str) -> Option<&'k ApiKey> {
    keys.iter().fold(None, |found, key| if key.opens(token) { Some(key) } else { found })
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECRET: &str = "correct-horse-battery-staple";

    #[test]
    fn key_opens_with_its_secret_only() {
        let key: ApiKey = format!("ci:read+submit:{SECRET}").parse().unwrap();
        assert!(key.opens(SECRET) && !key.opens("correct-horse-battery-stable") && !key.opens(""));
        assert!(key.allows(Scope::Read) && key.allows(Scope::Submit) && !key.allows(Scope::Operate));
        let hashed: ApiKey = format!("ci:read:blake3:{}", blake3::hash(SECRET.as_bytes())).parse().unwrap();
        assert!(hashed.opens(SECRET));
        assert!(!format!("{key:?}").contains(SECRET));
    }

    #[test]
    fn malformed_keys_are_refused_without_showing_the_secret() {
        for text in ["", "ci", "ci:read", ":read:x", "ci::x"] {
            assert_eq!(text.parse::<ApiKey>(), Err(KeyError::Shape), "{text}");
        }
        let unknown = format!("ci:write:{SECRET}").parse::<ApiKey>().unwrap_err();
        assert!(unknown.to_string().contains("write") && !unknown.to_string().contains(SECRET));
        assert_eq!("ci:read:short".parse::<ApiKey>(), Err(KeyError::Short { name: "ci".into() }));
        assert_eq!("ci:read:blake3:12".parse::<ApiKey>(), Err(KeyError::Hash { name: "ci".into() }));
    }

    #[test]
    fn only_loopback_goes_without_keys() {
        let key: ApiKey = format!("ci:read:{SECRET}").parse().unwrap();
        for loopback in ["127.0.0.1:80", "[::1]:80", "[::ffff:127.0.0.1]:80"] {
            assert!(require_keys(loopback.parse().unwrap(), &[], false).is_ok(), "{loopback}");
        }
        let open: SocketAddr = "0.0.0.0:80".parse().unwrap();
        assert!(require_keys(open, &[], false).is_err());
        assert!(require_keys(open, &[], true).is_ok());
        assert!(require_keys(open, &[key], false).is_ok());
    }
}
