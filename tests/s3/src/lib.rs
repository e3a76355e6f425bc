//! A store that speaks S3, within the tests: each folder has one of its own, on a thread that lives as long as the
//! process. It can be told to refuse, and to cut what it answers.

use std::{
    collections::HashMap,
    convert::Infallible,
    path::{Path, PathBuf},
    sync::{
        Arc, Mutex, OnceLock,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
};

use bytes::Bytes;
use http_body_util::{BodyExt, StreamBody, combinators::UnsyncBoxBody};
use hyper::{
    Request, Response,
    body::{Frame, Incoming},
    service::service_fn,
};
use hyper_util::rt::TokioIo;
use s3s::{
    auth::SimpleAuth,
    service::{S3Service, S3ServiceBuilder},
};

/// Who may call, where anyone has to say who he is.
pub const KEYS: [(&str, &str); 3] = [
    ("AWS_ACCESS_KEY_ID", "someone"),
    ("AWS_SECRET_ACCESS_KEY", "something that nobody guesses"),
    ("AWS_REGION", "us-east-1"),
];

/// What goes wrong.
#[derive(Debug, Default)]
pub struct Faults {
    /// So many of the next answers are a status of 500.
    pub refuse: AtomicU64,
    /// Whether nobody is let in.
    pub forbid: AtomicBool,
    /// So many of the next answers to a GET end in the middle.
    pub cut: AtomicU64,
    /// Requests that arrived.
    pub requests: AtomicU64,
    /// Those that were refused or cut.
    pub met: AtomicU64,
}

/// A store that is running.
#[derive(Clone)]
pub struct S3Server {
    /// Its address, with a bucket of its own.
    pub objects: String,
    pub endpoint: String,
    pub faults: Arc<Faults>,
}

type Body = UnsyncBoxBody<Bytes, Box<dyn std::error::Error + Send + Sync>>;

/// The store of a folder, which is begun where there is none yet. With `signed`, requests must be signed with [`KEYS`];
/// without, nobody signs.
pub fn of_folder(folder: &Path, signed: bool) -> S3Server {
    static SERVERS: OnceLock<Mutex<HashMap<(PathBuf, bool), S3Server>>> = OnceLock::new();
    let mut servers = SERVERS.get_or_init(Mutex::default).lock().unwrap();
    servers.entry((folder.to_owned(), signed)).or_insert_with(|| start(folder, signed)).clone()
}

fn start(folder: &Path, signed: bool) -> S3Server {
    let root = folder.join("s3");
    std::fs::create_dir_all(root.join("spectra")).unwrap();
    let mut service = S3ServiceBuilder::new(s3s_fs::FileSystem::new(&root).unwrap());
    if signed {
        service.set_auth(SimpleAuth::from_single(KEYS[0].1, KEYS[1].1));
    }
    let service = service.build();
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    listener.set_nonblocking(true).unwrap();
    let endpoint = format!("http://{}", listener.local_addr().unwrap());
    let faults = Arc::new(Faults::default());
    let objects = match signed {
        // Keys and endpoint come from the environment.
        true => "s3://spectra/lab/one".to_owned(),
        false => format!("s3://spectra/lab/one?endpoint={endpoint}&region=us-east-1&skip_signature=true"),
    };
    let told = Arc::clone(&faults);
    std::thread::spawn(move || {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        runtime.block_on(serve(listener, service, told));
    });
    S3Server { objects, endpoint, faults }
}

async fn serve(listener: std::net::TcpListener, service: S3Service, faults: Arc<Faults>) {
    let listener = tokio::net::TcpListener::from_std(listener).unwrap();
    loop {
        let Ok((socket, _)) = listener.accept().await else { continue };
        let (service, faults) = (service.clone(), Arc::clone(&faults));
        tokio::spawn(async move {
            let answer = service_fn(move |request| answer(service.clone(), Arc::clone(&faults), request));
            // A cut answer ends the connection.
            let _ = hyper::server::conn::http1::Builder::new().serve_connection(TokioIo::new(socket), answer).await;
        });
    }
}

/// Takes one of a number, if there is one.
fn take(from: &AtomicU64) -> bool {
    from.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| left.checked_sub(1)).is_ok()
}

async fn answer(
    service: S3Service,
    faults: Arc<Faults>,
    request: Request<Incoming>,
) -> Result<Response<Body>, Infallible> {
    faults.requests.fetch_add(1, Ordering::Relaxed);
    let reads = request.method() == hyper::Method::GET;
    if take(&faults.refuse) {
        faults.met.fetch_add(1, Ordering::Relaxed);
        // What was sent is taken, as a proxy would.
        let _ = request.into_body().collect().await;
        let body = http_body_util::Empty::new().map_err(|never| match never {}).boxed_unsync();
        return Ok(Response::builder().status(500).body(body).unwrap());
    }
    if faults.forbid.load(Ordering::Relaxed) {
        let _ = request.into_body().collect().await;
        let told = "<Error><Code>AccessDenied</Code><Message>Access Denied</Message></Error>";
        let body = http_body_util::Full::new(Bytes::from(told)).map_err(|never| match never {}).boxed_unsync();
        return Ok(Response::builder().status(403).body(body).unwrap());
    }
    let request = request.map(s3s::Body::from);
    let (head, body) = match service.call(request).await {
        Ok(response) => response.into_parts(),
        Err(error) => panic!("the store of the tests: {error:?}"),
    };
    let success = head.status.is_success();
    if reads && success && take(&faults.cut) {
        faults.met.fetch_add(1, Ordering::Relaxed);
        let whole = body.collect().await.map(http_body_util::Collected::to_bytes).unwrap_or_default();
        let half = whole.slice(..whole.len() / 2);
        let frames = vec![Ok(Frame::data(half)), Err("the answer ends in the middle".into())];
        let body = StreamBody::new(futures_util::stream::iter(frames)).boxed_unsync();
        return Ok(Response::from_parts(head, body));
    }
    Ok(Response::from_parts(head, body.boxed_unsync()))
}
