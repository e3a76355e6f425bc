//! Objects in a store that speaks S3: how its address is read, how long it is waited for, and what its failures mean.

use std::{sync::Once, time::Duration};

use object_store::{
    BackoffConfig, ClientConfigKey, RetryConfig,
    aws::{AmazonS3, AmazonS3Builder, AmazonS3ConfigKey, Checksum},
};

use super::StoreError;

/// A request that got no byte for so long is given up, and tried again.
const SILENCE: Duration = Duration::from_secs(10);
/// The whole of a request: a part or a range of 8 MiB, at half a megabyte a second.
const WHOLE: Duration = Duration::from_secs(30);
/// Someone waits for an answer: what does not work after so long is told.
const HASTE: Duration = Duration::from_secs(8);
/// What was computed for minutes is worth some waiting.
const PATIENCE: Duration = Duration::from_secs(300);

/// The same store twice: for those who wait for an answer, and for what is not to be lost.
#[derive(Debug)]
pub(super) struct S3 {
    /// Gives up within seconds.
    pub hasty: AmazonS3,
    /// Goes on trying for minutes.
    pub patient: AmazonS3,
    /// The folder within the bucket; empty for the whole of it.
    pub prefix: String,
}

/// Why an address cannot be used.
type Refusal = String;

impl S3 {
    /// Opens the store at what stands behind `s3://`: `BUCKET/PREFIX?endpoint=…&region=…`. What the address does not
    /// say is taken from the usual variables `AWS_…`, keys always.
    pub fn open(place: &str) -> Result<Self, Refusal> {
        let (path, settings) = place.split_once('?').unwrap_or((place, ""));
        let (bucket, prefix) = path.split_once('/').unwrap_or((path, ""));
        if bucket.is_empty() {
            return Err("the bucket is missing after s3://".to_owned());
        }
        install_cryptography();
        let mut builder = AmazonS3Builder::from_env().with_bucket_name(bucket);
        for (name, value) in form_urlencoded::parse(settings.as_bytes()) {
            builder = builder.with_config(setting(&name)?, value);
        }
        // Whoever writes http:// into an address means it.
        let endpoints = [AmazonS3ConfigKey::Endpoint, AmazonS3ConfigKey::S3Endpoint];
        let plain = endpoints
            .iter()
            .filter_map(|key| builder.get_config_value(key))
            .any(|endpoint| endpoint.starts_with("http://"));
        if plain {
            builder = builder.with_config(AmazonS3ConfigKey::Client(ClientConfigKey::AllowHttp), "true");
        }
        let builder = builder.with_checksum_algorithm(Checksum::SHA256);
        let open = |retries: usize, longest: Duration| {
            let backoff = BackoffConfig {
                init_backoff: Duration::from_millis(100),
                max_backoff: Duration::from_secs(5),
                base: 2.,
            };
            builder
                .clone()
                .with_config(AmazonS3ConfigKey::Client(ClientConfigKey::ReadTimeout), seconds(SILENCE))
                .with_config(AmazonS3ConfigKey::Client(ClientConfigKey::Timeout), seconds(WHOLE))
                .with_retry(RetryConfig { backoff, max_retries: retries, retry_timeout: longest })
                .build()
                .map_err(|error| error.to_string())
        };
        Ok(Self {
            hasty: open(3, HASTE)?,
            patient: open(usize::MAX, PATIENCE)?,
            prefix: prefix.trim_matches('/').to_owned(),
        })
    }
}

fn seconds(time: Duration) -> String {
    format!("{} s", time.as_secs())
}

/// A setting that an address may have.
fn setting(name: &str) -> Result<AmazonS3ConfigKey, Refusal> {
    use AmazonS3ConfigKey as Key;
    let key: Key = name.parse().map_err(|_| format!("there is no setting {name:?}"))?;
    match key {
        Key::Endpoint | Key::Region | Key::VirtualHostedStyleRequest | Key::SkipSignature | Key::UnsignedPayload => {
            Ok(key)
        }
        Key::AccessKeyId | Key::SecretAccessKey | Key::Token => {
            Err(format!("{name} must not be in the URL; set AWS_ACCESS_KEY_ID and related variables"))
        }
        _ => Err(format!(
            "the URL takes no setting {name:?}; it takes endpoint, region, virtual_hosted_style_request, unsigned_payload and skip_signature. Set all others in the environment"
        )),
    }
}

/// What encrypts connections to the store: the library that those to the database use as well.
fn install_cryptography() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        // One that is there already serves as well.
        let _ = rustls::crypto::ring::default_provider().install_default();
    });
}

/// What a store says that will say the same however often it is asked.
const REFUSALS: [&str; 7] = [
    "NoSuchBucket",
    "InvalidBucketName",
    "InvalidAccessKeyId",
    "SignatureDoesNotMatch",
    "AuthorizationHeaderMalformed",
    "PermanentRedirect",
    "incorrectly configured region",
];

/// What a store answered, for people: its own code and words where it has any.
pub(super) fn said(error: &object_store::Error) -> String {
    let text = error.to_string();
    let within = |name: &str| {
        let rest = text.split_once(&format!("<{name}>"))?.1;
        Some(rest.split_once("</")?.0.trim()).filter(|own| !own.is_empty())
    };
    match (within("Code"), within("Message")) {
        (Some(code), Some(message)) => format!("{code}: {message}"),
        (Some(code), None) => code.to_owned(),
        _ => text,
    }
}

/// Whether an object is not there. Where its whole bucket is not, nothing is known of it.
pub(super) fn is_missing(error: &object_store::Error) -> bool {
    matches!(error, object_store::Error::NotFound { .. }) && !said(error).contains(REFUSALS[0])
}

/// What went wrong, as an error. Whom the store does not let in, and a bucket that is not there, are no outage that
/// passes.
pub(super) fn failure(error: &object_store::Error) -> StoreError {
    let said = said(error);
    let refused = REFUSALS.iter().any(|words| said.contains(words))
        || matches!(error, object_store::Error::PermissionDenied { .. } | object_store::Error::Unauthenticated { .. });
    let detail = format!("the object store: {said}");
    if refused { StoreError::Refused { detail } } else { StoreError::Unavailable { detail } }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_read_and_refused() {
        let read =
            S3::open("spectra/lab/one/?endpoint=http%3A%2F%2F127.0.0.1:9&region=here&skip_signature=true").unwrap();
        assert_eq!(read.prefix, "lab/one");
        assert_eq!(read.hasty.to_string(), "AmazonS3(spectra)");
        assert_eq!(S3::open("spectra?region=here").unwrap().prefix, "");
        for (address, said) in [
            ("", "bucket"),
            ("/lab", "bucket"),
            ("spectra?secret_access_key=x", "AWS_ACCESS_KEY_ID"),
            ("spectra?token=x", "AWS_ACCESS_KEY_ID"),
            ("spectra?color=blue", "color"),
            ("spectra?checksum_algorithm=crc64nvme", "checksum_algorithm"),
        ] {
            let refusal = S3::open(address).unwrap_err();
            assert!(refusal.contains(said) && !refusal.contains('\n'), "{address}: {refusal}");
        }
    }

    #[test]
    fn refusals_are_told_from_outages() {
        let says = |text: &str| object_store::Error::Generic { store: "S3", source: text.to_owned().into() };
        let missing =
            |text: &str| object_store::Error::NotFound { path: "b/x".to_owned(), source: text.to_owned().into() };
        let body = |code: &str| format!("status 404: <Error><Code>{code}</Code><Message>so it is</Message></Error>");
        assert!(is_missing(&missing("no body")) && is_missing(&missing(&body("NoSuchKey"))));
        let no_bucket = missing(&body("NoSuchBucket"));
        assert!(!is_missing(&no_bucket));
        let told = failure(&no_bucket).to_string();
        assert_eq!(told, "the storage refuses: the object store: NoSuchBucket: so it is");
        assert!(matches!(failure(&says(&body("SignatureDoesNotMatch"))), StoreError::Refused { .. }));
        for outage in ["connection refused".to_owned(), body("SlowDown"), body("InternalError")] {
            assert!(matches!(failure(&says(&outage)), StoreError::Unavailable { .. }), "{outage}");
        }
    }
}
