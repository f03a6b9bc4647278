//! The server of the page: a raw client against limits, headers, token, other sites, and readers of events.

use std::fmt::Write as _;
use std::io::{ErrorKind, Read, Write};
use std::net::{Shutdown, SocketAddr, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Receiver;
use std::thread;
use std::time::{Duration, Instant};

use hydroid_live::page::{Asset, MAX_SAID, MAX_SERIES, MAX_TRACK, Options, Page, Request, random_token};
use serde_json::{Value, json};

const TOKEN: &str = "0123456789abcdef0123456789abcdef";
static LARGE: [u8; 8 << 20] = [b' '; 8 << 20];
static ASSETS: [Asset; 3] = [
    Asset {
        path: "/",
        content_type: "text/html; charset=utf-8",
        content: b"<!doctype html><title>page</title>",
    },
    Asset { path: "/page.js", content_type: "text/javascript", content: b"'use strict';" },
    Asset { path: "/large", content_type: "text/plain", content: &LARGE },
];

fn options() -> Options {
    Options {
        address: SocketAddr::from(([127, 0, 0, 1], 0)),
        token: TOKEN.to_owned(),
        names: vec!["boat.local".to_owned()],
    }
}

fn start() -> (Page, Receiver<Request>) {
    Page::start(options(), &ASSETS).unwrap()
}

/// A page whose service does each action and answers with its name, and refuses `steer`.
fn served() -> (Page, thread::JoinHandle<Vec<Value>>) {
    let (page, requests) = start();
    let service = thread::spawn(move || {
        let mut actions = Vec::new();
        for request in requests {
            let name = request.action["action"].as_str().unwrap().to_owned();
            let answer =
                if name == "steer" { Err("no position".to_owned()) } else { Ok(format!("did {name}")) };
            actions.push(request.action);
            request.reply.send(answer);
        }
        actions
    });
    (page, service)
}

fn connect(page: &Page) -> TcpStream {
    let stream = TcpStream::connect(page.address()).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
    stream.set_write_timeout(Some(Duration::from_secs(20))).unwrap();
    stream
}

#[derive(Debug)]
struct Answer {
    status: u16,
    headers: Vec<(String, String)>,
    body: Vec<u8>,
}

impl Answer {
    fn header(&self, name: &str) -> Option<&str> {
        self.headers.iter().find(|(key, _)| key == name).map(|(_, value)| value.as_str())
    }

    fn json(&self) -> Value {
        serde_json::from_slice(&self.body).unwrap()
    }

    fn error(&self) -> String {
        assert_eq!(self.header("content-type"), Some("application/json"));
        self.json()["error"].as_str().unwrap().to_owned()
    }
}

fn parse(bytes: &[u8]) -> Answer {
    let head = bytes.windows(4).position(|window| window == b"\r\n\r\n").expect("an answer has a head");
    let text = std::str::from_utf8(&bytes[..head]).unwrap();
    let mut lines = text.split("\r\n");
    let status = lines.next().unwrap().split(' ').nth(1).unwrap().parse().unwrap();
    let headers = lines.map(|line| line.split_once(": ").unwrap());
    let headers = headers.map(|(name, value)| (name.to_ascii_lowercase(), value.to_owned())).collect();
    Answer { status, headers, body: bytes[head + 4..].to_vec() }
}

/// The answer to a request, whose headers are all there.
fn ask(page: &Page, request: &[u8]) -> Answer {
    let mut stream = connect(page);
    stream.write_all(request).unwrap();
    let mut bytes = Vec::new();
    stream.read_to_end(&mut bytes).unwrap();
    let answer = parse(&bytes);
    check_headers(&answer);
    answer
}

fn check_headers(answer: &Answer) {
    let policy = "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self' data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";
    let expected = [
        ("content-security-policy", policy),
        ("x-content-type-options", "nosniff"),
        ("referrer-policy", "no-referrer"),
        ("cache-control", "no-store"),
        ("cross-origin-resource-policy", "same-origin"),
    ];
    for (name, value) in expected {
        assert_eq!(answer.header(name), Some(value), "{name} of {}", answer.status);
        assert_eq!(answer.headers.iter().filter(|(key, _)| key == name).count(), 1, "{name}");
    }
    assert!(answer.header("access-control-allow-origin").is_none());
}

fn get(page: &Page, path: &str) -> Answer {
    ask(page, format!("GET {path} HTTP/1.1\r\nHost: {}\r\n\r\n", page.address()).as_bytes())
}

fn request(page: &Page, headers: &str, body: &str) -> String {
    let (address, length) = (page.address(), body.len());
    format!("POST /action HTTP/1.1\r\nHost: {address}\r\nContent-Length: {length}\r\n{headers}\r\n{body}")
}

fn authorised() -> String {
    format!("Authorization: Bearer {TOKEN}\r\nContent-Type: application/json\r\n")
}

fn post(page: &Page, headers: &str, body: &str) -> Answer {
    ask(page, request(page, headers, body).as_bytes())
}

const STOP: &str = r#"{"action": "stop"}"#;

/// A reader of events.
struct Reader {
    stream: TcpStream,
    /// Bytes that are not decoded yet, and text that is not an event yet.
    raw: Vec<u8>,
    text: String,
}

impl Reader {
    fn open(page: &Page) -> Result<Self, Answer> {
        Self::with(page, "")
    }

    fn with(page: &Page, headers: &str) -> Result<Self, Answer> {
        let mut stream = connect(page);
        let request = format!("GET /events HTTP/1.1\r\nHost: {}\r\n{headers}\r\n", page.address());
        stream.write_all(request.as_bytes()).unwrap();
        let mut raw = Vec::new();
        while !raw.windows(4).any(|window| window == b"\r\n\r\n") {
            let mut chunk = [0; 4096];
            let read = stream.read(&mut chunk).unwrap();
            assert!(read > 0, "the connection was closed");
            raw.extend_from_slice(&chunk[..read]);
        }
        let mut answer = parse(&raw);
        check_headers(&answer);
        if answer.status != 200 {
            stream.read_to_end(&mut answer.body).unwrap();
            return Err(answer);
        }
        assert_eq!(answer.header("content-type"), Some("text/event-stream"));
        Ok(Self { stream, raw: answer.body, text: String::new() })
    }

    /// The next event; a comment has no name, the end of the connection is `None`.
    fn next(&mut self) -> Option<(String, Value)> {
        loop {
            if let Some(end) = self.text.find("\n\n") {
                let block: String = self.text.drain(..end + 2).collect();
                let (mut name, mut data) = (String::new(), Value::Null);
                for line in block.lines().filter(|line| !line.is_empty()) {
                    match line.split_once(": ") {
                        Some(("event", text)) => text.clone_into(&mut name),
                        Some(("data", text)) => data = serde_json::from_str(text).unwrap(),
                        Some(("retry", text)) => assert!(text.parse::<u32>().is_ok()),
                        _ => assert_eq!(line, ":"),
                    }
                }
                return Some((name, data));
            }
            // A chunk of the transfer: its length, its content, a line end.
            if let Some(line) = self.raw.windows(2).position(|window| window == b"\r\n") {
                let length =
                    usize::from_str_radix(std::str::from_utf8(&self.raw[..line]).unwrap(), 16).unwrap();
                if self.raw.len() >= line + 4 + length {
                    let content = &self.raw[line + 2..line + 2 + length];
                    self.text.push_str(std::str::from_utf8(content).unwrap());
                    self.raw.drain(..line + 4 + length);
                    continue;
                }
            }
            let mut chunk = [0; 1 << 13];
            match self.stream.read(&mut chunk) {
                Ok(0) => return None,
                Ok(read) => self.raw.extend_from_slice(&chunk[..read]),
                Err(error) if error.kind() == ErrorKind::ConnectionReset => return None,
                Err(error) => panic!("{error}"),
            }
        }
    }

    fn expect(&mut self, event: &str) -> Value {
        let (name, data) = self.next().expect("the connection is open");
        assert_eq!(name, event);
        data
    }

    fn state(&mut self) -> Value {
        loop {
            let (name, data) = self.next().expect("the connection is open");
            if name == "state" {
                return data;
            }
        }
    }
}

#[test]
fn files_have_types_and_headers() {
    let (page, _requests) = start();
    let index = get(&page, "/");
    assert_eq!((index.status, index.header("content-type")), (200, Some("text/html; charset=utf-8")));
    assert_eq!(index.body, ASSETS[0].content);
    assert_eq!(get(&page, "/?query").status, 200);
    assert_eq!(get(&page, "/page.js").header("content-type"), Some("text/javascript"));
    let large = get(&page, "/large");
    assert_eq!((large.status, large.body.len()), (200, LARGE.len()));

    for path in ["/", "/large"] {
        let head = ask(&page, format!("HEAD {path} HTTP/1.1\r\nHost: localhost\r\n\r\n").as_bytes());
        let length = ASSETS.iter().find(|asset| asset.path == path).unwrap().content.len().to_string();
        assert_eq!((head.status, head.body.len()), (200, 0));
        assert_eq!(head.header("content-length"), Some(length.as_str()));
    }
    let head = ask(&page, b"HEAD /events HTTP/1.1\r\nHost: localhost\r\n\r\n");
    assert_eq!((head.status, head.body.len()), (200, 0));
}

#[test]
fn other_paths_and_methods_are_refused() {
    let (page, _requests) = start();
    let paths = [
        "/none",
        "/page.js/",
        "//page.js",
        "/../Cargo.toml",
        "/%2e%2e/Cargo.toml",
        "/page.js%00",
        "/%70age.js",
    ];
    for path in paths {
        let answer = get(&page, path);
        assert_eq!(answer.status, 404, "{path}");
        assert!(!answer.error().is_empty());
    }
    for (method, path, allow) in [
        ("POST", "/", "GET,HEAD"),
        ("PUT", "/page.js", "GET,HEAD"),
        ("OPTIONS", "/", "GET,HEAD"),
        ("POST", "/events", "GET,HEAD"),
        ("GET", "/action", "POST"),
        ("OPTIONS", "/action", "POST"),
        ("DELETE", "/action", "POST"),
    ] {
        let answer = ask(&page, format!("{method} {path} HTTP/1.1\r\nHost: localhost\r\n\r\n").as_bytes());
        assert_eq!((answer.status, answer.header("allow")), (405, Some(allow)), "{method} {path}");
        assert!(answer.error().contains(if allow == "POST" { "POST" } else { "GET" }));
    }
}

#[test]
fn damaged_requests_are_refused_with_all_headers() {
    let (page, _requests) = start();
    for request in [
        "\0\0\0\0\r\n\r\n",
        "GET / HTTP/9.9\r\nHost: localhost\r\n\r\n",
        "GET\r\n\r\n",
        "GET / HTTP/1.1\r\nHost localhost\r\n\r\n",
        "PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n",
        // TLS.
        "\u{16}\u{3}\u{1}\u{2}\0\u{1}\0\u{1}\r\n\r\n",
        "GET / HTTP/1.1\r\n\r\n",
        "GET / HTTP/1.1\r\nHost: localhost\r\nHost: localhost\r\n\r\n",
        "GET http://localhost/ HTTP/1.1\r\nHost: localhost\r\n\r\n",
        "OPTIONS * HTTP/1.1\r\nHost: localhost\r\n\r\n",
        "CONNECT localhost:80 HTTP/1.1\r\nHost: localhost\r\n\r\n",
        "POST /action HTTP/1.1\r\nHost: localhost\r\nContent-Length: 1\r\nContent-Length: 2\r\n\r\n",
    ] {
        let answer = ask(&page, request.as_bytes());
        assert_eq!(answer.status, 400, "{request:?}");
        assert!(!answer.error().is_empty());
    }
}

#[test]
fn large_heads_are_refused() {
    let (page, _requests) = start();
    let long = format!("GET / HTTP/1.1\r\nHost: localhost\r\nX: {}\r\n\r\n", "x".repeat(100_000));
    let path = format!("GET /{} HTTP/1.1\r\nHost: localhost\r\n\r\n", "x".repeat(100_000));
    let mut many = "GET / HTTP/1.1\r\nHost: localhost\r\n".to_owned();
    for i in 0..100 {
        write!(many, "X-{i}: x\r\n").unwrap();
    }
    many += "\r\n";
    // More than what is read after an answer: the connection may be reset, but it ends.
    let endless = format!("GET / HTTP/1.1\r\nHost: localhost\r\nX: {}", "x".repeat(8 << 20));
    for request in [long, path, many] {
        let (mut stream, mut bytes) = (connect(&page), Vec::new());
        stream.write_all(request.as_bytes()).unwrap();
        // The answer of a connection that was reset would be lost by now.
        thread::sleep(Duration::from_millis(200));
        stream.read_to_end(&mut bytes).unwrap();
        let answer = parse(&bytes);
        check_headers(&answer);
        assert_eq!(answer.status, 431);
        assert!(answer.error().contains("headers"));
    }
    let (mut stream, begin) = (connect(&page), Instant::now());
    let _ = stream.write_all(endless.as_bytes());
    let _ = stream.read_to_end(&mut Vec::new());
    assert!(begin.elapsed() < Duration::from_secs(5));
    assert_eq!(get(&page, "/").status, 200);
}

#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn slow_heads_end_and_others_go_on() {
    let (page, _requests) = start();
    thread::scope(|scope| {
        // A header that never ends.
        scope.spawn(|| {
            let (mut stream, begin) = (connect(&page), Instant::now());
            stream.write_all(b"GET / HTTP/1.1\r\nHost: localhost\r\nX: ").unwrap();
            stream.set_read_timeout(Some(Duration::from_millis(200))).unwrap();
            let mut bytes = Vec::new();
            loop {
                let mut chunk = [0; 4096];
                match stream.read(&mut chunk) {
                    Ok(0) => break,
                    Ok(read) => bytes.extend_from_slice(&chunk[..read]),
                    Err(error) if error.kind() == ErrorKind::WouldBlock => {
                        assert!(begin.elapsed() < Duration::from_secs(8));
                        let _ = stream.write_all(b"x");
                    }
                    Err(error) => panic!("{error}"),
                }
            }
            let answer = parse(&bytes);
            check_headers(&answer);
            assert_eq!(answer.status, 408);
            assert!(begin.elapsed() > Duration::from_secs(4));
        });
        // A connection without a request is closed without an answer.
        scope.spawn(|| {
            let (mut stream, begin, mut bytes) = (connect(&page), Instant::now(), Vec::new());
            stream.read_to_end(&mut bytes).unwrap();
            assert!(bytes.is_empty() && begin.elapsed() < Duration::from_secs(8));
        });
        // The body of an action that never ends.
        scope.spawn(|| {
            let begin = Instant::now();
            let answer = ask(
                &page,
                format!(
                    "POST /action HTTP/1.1\r\nHost: localhost\r\nContent-Length: 100\r\n{}\r\n{{",
                    authorised()
                )
                .as_bytes(),
            );
            assert_eq!(answer.status, 408);
            assert!(begin.elapsed() < Duration::from_secs(8));
        });
        scope.spawn(|| {
            for _ in 0..20 {
                let begin = Instant::now();
                assert_eq!(get(&page, "/").status, 200);
                assert!(begin.elapsed() < Duration::from_secs(1));
                thread::sleep(Duration::from_millis(100));
            }
        });
    });
}

#[test]
fn actions_reach_the_service() {
    let (page, service) = served();
    let answer = post(&page, &authorised(), r#"{"action": "experiment", "name": "zigzag-20"}"#);
    assert_eq!((answer.status, answer.json()), (200, json!({ "done": "did experiment" })));
    assert_eq!(answer.header("content-type"), Some("application/json"));
    let refused = post(&page, &authorised(), r#"{"action": "steer"}"#);
    assert_eq!((refused.status, refused.json()), (409, json!({ "error": "no position" })));

    // Sent in chunks, with parameters of the media type, by a client that asks whether it may go on.
    let chunked = format!(
        "POST /action HTTP/1.1\r\nHost: boat.local\r\nTransfer-Encoding: chunked\r\nAuthorization: bearer {TOKEN}\r\nContent-Type: Application/JSON; charset=utf-8\r\n\r\n5\r\n{{\"act\r\nd\r\nion\": \"stop\"}}\r\n0\r\n\r\n"
    );
    assert_eq!(ask(&page, chunked.as_bytes()).json(), json!({ "done": "did stop" }));

    for (body, reason) in [
        ("", "not JSON"),
        ("{", "not JSON"),
        ("[]", "object"),
        ("\"stop\"", "object"),
        (r#"{"action": 1}"#, "object"),
        (r#"{"action": "stop"} {"#, "not JSON"),
        (&"[".repeat(4000), "not JSON"),
        ("{\"action\": \"\u{7}\"}", "not JSON"),
    ] {
        let answer = post(&page, &authorised(), body);
        assert_eq!(answer.status, 400, "{body}");
        assert!(answer.error().contains(reason), "{body}: {}", answer.error());
    }
    for content_type in
        ["", "Content-Type: text/plain\r\n", "Content-Type: application/x-www-form-urlencoded\r\n"]
    {
        let answer = post(&page, &format!("Authorization: Bearer {TOKEN}\r\n{content_type}"), STOP);
        assert_eq!(answer.status, 400);
        assert!(answer.error().contains("Content-Type"));
    }
    drop(page);
    let names: Vec<Value> =
        service.join().unwrap().into_iter().map(|mut action| action["action"].take()).collect();
    assert_eq!(names, ["experiment", "steer", "stop"]);
}

#[test]
fn oversize_bodies_are_refused() {
    let (page, service) = served();
    let body = |length: usize| format!("{{\"action\": \"stop\", \"x\": \"{}\"}}", "x".repeat(length - 27));
    assert_eq!(body(4096).len(), 4096);
    assert_eq!(post(&page, &authorised(), &body(4096)).status, 200);
    for length in [4097, 100_000] {
        let answer = post(&page, &authorised(), &body(length));
        assert_eq!(answer.status, 413);
        assert!(answer.error().contains("4096"));
    }
    let mut chunked = format!(
        "POST /action HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n{}\r\n",
        authorised()
    );
    for _ in 0..10 {
        write!(chunked, "400\r\n{}\r\n", " ".repeat(1024)).unwrap();
    }
    assert_eq!(ask(&page, chunked.as_bytes()).status, 413);
    // Only announced: nothing is waited for.
    let begin = Instant::now();
    let announced = format!(
        "POST /action HTTP/1.1\r\nHost: localhost\r\nContent-Length: 99999999999\r\n{}\r\n",
        authorised()
    );
    assert_eq!(ask(&page, announced.as_bytes()).status, 413);
    assert!(begin.elapsed() < Duration::from_secs(3));
    drop(page);
    assert_eq!(service.join().unwrap().len(), 1);
}

#[test]
fn actions_need_the_token() {
    let (page, service) = served();
    let json = "Content-Type: application/json\r\n";
    let swapped = format!("1{}", &TOKEN[1..]);
    for header in [
        String::new(),
        "Authorization: Bearer\r\n".to_owned(),
        "Authorization: Bearer \r\n".to_owned(),
        format!("Authorization: {TOKEN}\r\n"),
        format!("Authorization: Basic {TOKEN}\r\n"),
        format!("Authorization: Bearer {}\r\n", &TOKEN[..31]),
        format!("Authorization: Bearer {TOKEN}0\r\n"),
        format!("Authorization: Bearer {swapped}\r\n"),
        format!("Authorization: Bearer {}\r\n", TOKEN.to_uppercase()),
        format!("Authorization: Bearer {TOKEN} {TOKEN}\r\n"),
        format!("Authorization: Bearer {TOKEN}\r\nAuthorization: Bearer {TOKEN}\r\n"),
        format!("Cookie: token={TOKEN}\r\n"),
    ] {
        let answer = post(&page, &format!("{json}{header}"), STOP);
        assert_eq!((answer.status, answer.header("www-authenticate")), (401, Some("Bearer")), "{header}");
        assert!(answer.error().contains("token") && !answer.error().contains(TOKEN));
    }
    drop(page);
    assert!(service.join().unwrap().is_empty());
}

#[test]
fn tokens_are_random_and_long() {
    let tokens: Vec<String> = (0..100).map(|_| random_token().unwrap()).collect();
    for (i, token) in tokens.iter().enumerate() {
        assert!(token.len() == 32 && token.bytes().all(|byte| byte.is_ascii_hexdigit()));
        assert!(!tokens[..i].contains(token));
    }
    for token in ["", "short", "with a blank in the middle", "0123456789abcdef\n"] {
        let error = Page::start(Options { token: token.to_owned(), ..options() }, &ASSETS).err().unwrap();
        assert_eq!(error.kind(), ErrorKind::InvalidInput);
    }
}

#[test]
fn requests_of_other_sites_are_refused() {
    let (page, service) = served();
    let (address, port) = (page.address(), page.address().port());
    for headers in [
        "Origin: http://evil.example\r\n".to_owned(),
        format!("Origin: http://{address}.evil.example\r\n"),
        format!("Origin: http://evil.example@{address}\r\n"),
        format!("Origin: http://localhost:{port}\r\n"),
        "Origin: http://127.0.0.1\r\n".to_owned(),
        format!("Origin: {address}\r\n"),
        format!("Origin: ftp://{address}\r\n"),
        "Origin: \r\n".to_owned(),
        "Origin: null\r\n".to_owned(),
        "Origin: null\r\nSec-Fetch-Site: none\r\n".to_owned(),
        format!("Origin: http://{address}\r\nOrigin: http://{address}\r\n"),
        "Sec-Fetch-Site: cross-site\r\n".to_owned(),
        "Sec-Fetch-Site: same-site\r\n".to_owned(),
        "Sec-Fetch-Site: unknown\r\n".to_owned(),
        "Sec-Fetch-Site: same-origin\r\nSec-Fetch-Site: cross-site\r\n".to_owned(),
        format!("Origin: http://{address}\r\nSec-Fetch-Site: cross-site\r\n"),
    ] {
        let answer = post(&page, &format!("{}{headers}", authorised()), STOP);
        assert_eq!(answer.status, 403, "{headers}");
        assert!(answer.error().contains("another site"));
        // Without the token, too, and events.
        assert_eq!(post(&page, &headers, STOP).status, 403, "{headers}");
        assert_eq!(Reader::with(&page, &headers).err().unwrap().status, 403, "{headers}");
    }
    for headers in [
        format!("Origin: http://{address}\r\n"),
        format!("Origin: http://{address}\r\nSec-Fetch-Site: same-origin\r\n"),
        "Origin: null\r\nSec-Fetch-Site: same-origin\r\n".to_owned(),
        "Sec-Fetch-Site: none\r\n".to_owned(),
    ] {
        assert_eq!(post(&page, &format!("{}{headers}", authorised()), STOP).status, 200, "{headers}");
    }
    // A link of another site may open the page.
    let link = format!("GET / HTTP/1.1\r\nHost: {address}\r\nSec-Fetch-Site: cross-site\r\n\r\n");
    assert_eq!(ask(&page, link.as_bytes()).status, 200);
    drop(page);
    assert_eq!(service.join().unwrap().len(), 4);
}

#[test]
fn names_of_other_sites_are_refused() {
    let (page, _requests) = start();
    let own = [
        "localhost",
        "LOCALHOST:8600",
        "localhost.",
        "127.0.0.1",
        "127.0.0.1:8600",
        "192.168.1.7:8600",
        "[::1]",
        "[fe80::1]:8600",
        "boat.local",
        "Boat.Local:8600",
    ];
    for host in own {
        let answer = ask(&page, format!("GET / HTTP/1.1\r\nHost: {host}\r\n\r\n").as_bytes());
        assert_eq!(answer.status, 200, "{host}");
    }
    let other = [
        "evil.example",
        "evil.example:8600",
        "localhost.evil.example",
        "127.0.0.1.evil.example",
        "evil.boat.local",
        "boat.local.evil.example",
        "127.1",
        "0x7f.0.0.1",
        "2130706433",
        "[::1].evil.example",
        "[::1",
        "[::1]8600",
        "[localhost]",
        "[127.0.0.1]",
        "::1",
        "localhost:",
        "localhost:x",
        "localhost:+80",
        "localhost:70000",
        "",
        "localhost:80:80",
        "evil.example:80@localhost",
    ];
    for host in other {
        for target in ["GET /", "GET /events", "POST /action"] {
            let request = format!("{target} HTTP/1.1\r\nHost: {host}\r\n{}\r\n", authorised());
            let answer = ask(&page, request.as_bytes());
            assert_eq!(answer.status, 403, "{target} {host}");
            assert!(answer.error().contains("host name"));
        }
    }
}

#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn a_service_without_answer_is_told() {
    let (page, requests) = start();
    thread::scope(|scope| {
        let (page, begin) = (&page, Instant::now());
        let waiting = scope.spawn(|| post(page, &authorised(), r#"{"action": "record"}"#));
        let request = requests.recv_timeout(Duration::from_secs(5)).unwrap();
        assert!(request.reply.is_awaited());
        let answer = waiting.join().unwrap();
        assert_eq!((answer.status, answer.header("retry-after")), (503, Some("1")));
        assert!((4.5..7.0).contains(&begin.elapsed().as_secs_f64()));
        assert!(!request.reply.is_awaited());
        request.reply.send(Ok("late".to_owned()));

        // The reply is dropped.
        let waiting = scope.spawn(|| post(page, &authorised(), STOP));
        drop(requests.recv_timeout(Duration::from_secs(5)).unwrap());
        assert_eq!(waiting.join().unwrap().status, 503);
    });
    drop(requests);
    let begin = Instant::now();
    assert_eq!(post(&page, &authorised(), STOP).status, 503);
    assert!(begin.elapsed() < Duration::from_secs(2));
}

#[test]
fn an_action_is_done_even_if_the_operator_leaves() {
    let (page, service) = served();
    for i in 0..50 {
        let mut stream = connect(&page);
        stream.write_all(request(&page, &authorised(), STOP).as_bytes()).unwrap();
        if i % 2 == 0 {
            stream.shutdown(Shutdown::Write).unwrap();
            let mut bytes = Vec::new();
            stream.read_to_end(&mut bytes).unwrap();
            assert_eq!(parse(&bytes).status, 200);
        }
    }
    // An incomplete one is not.
    let mut stream = connect(&page);
    let request = request(&page, &authorised(), STOP);
    stream.write_all(&request.as_bytes()[..request.len() - 1]).unwrap();
    stream.shutdown(Shutdown::Write).unwrap();
    let mut bytes = Vec::new();
    stream.read_to_end(&mut bytes).unwrap();
    assert_eq!(parse(&bytes).status, 400);
    drop(page);
    assert_eq!(service.join().unwrap().len(), 50);
}

#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn a_service_that_hangs_gets_few_requests() {
    let (page, requests) = start();
    // Operators that leave do not fill the memory.
    for _ in 0..100 {
        let mut stream = connect(&page);
        stream.write_all(request(&page, &authorised(), STOP).as_bytes()).unwrap();
    }
    let answer = post(&page, &authorised(), STOP);
    assert_eq!(answer.status, 503);
    assert!(answer.error().contains("too many"));
    assert_eq!(get(&page, "/").status, 200);
    let queued = requests.try_iter().collect::<Vec<_>>();
    assert_eq!(queued.len(), 16);
    assert!(queued.iter().all(|request| request.reply.is_awaited()));
    thread::sleep(Duration::from_secs(6));
    assert!(queued.iter().all(|request| !request.reply.is_awaited()));
}

#[test]
fn history_comes_first_in_bounded_size() {
    let (page, _requests) = start();
    page.name_series(&["x".to_owned()]);
    page.series(0.0, &[1.0], &[2.0]);
    page.name_series(&["u".to_owned(), "r".to_owned()]);
    for i in 0..5000_i32 {
        let t = f64::from(i);
        page.track([t, 0.5, f64::NAN, -1.0]);
        page.series(t, &[1.0, f64::INFINITY], &[3.0]);
        page.said(json!({ "id": i, "text": "\r\n\u{2028}event: state" }).to_string());
    }
    page.state("{\n\"n\": 1,\r\n\"text\": \"data: \"}".to_owned());
    let mut reader = Reader::open(&page).unwrap();
    let history = reader.expect("history");
    let track = history["track"].as_array().unwrap();
    assert_eq!(track.len(), MAX_TRACK);
    assert_eq!(track[0], json!([2000.0, 0.5, null, -1.0]));
    assert_eq!(track[MAX_TRACK - 1][0], json!(4999.0));
    assert_eq!(history["series"]["names"], json!(["u", "r"]));
    let rows = history["series"]["rows"].as_array().unwrap();
    assert_eq!(rows.len(), MAX_SERIES);
    assert_eq!(rows[0], json!([3800.0, 1.0, null, 3.0, null]));
    assert_eq!(rows[MAX_SERIES - 1][0], json!(4999.0));
    let said = history["said"].as_array().unwrap();
    assert_eq!(said.len(), MAX_SAID);
    assert_eq!((&said[0]["id"], &said[MAX_SAID - 1]["id"]), (&json!(4800), &json!(4999)));
    assert_eq!(reader.expect("state"), json!({ "n": 1, "text": "data: " }));
    page.said(json!({ "id": 5000 }).to_string());
    assert_eq!(reader.expect("said"), json!({ "id": 5000 }));
}

#[test]
fn the_handle_is_shared_by_threads() {
    fn check<T: Send + Sync>() {}
    check::<Page>();
    check::<Options>();
}

#[test]
fn an_empty_history_is_valid() {
    let (page, _requests) = start();
    page.series(1.0, &[1.0], &[1.0]);
    let history = Reader::open(&page).unwrap().expect("history");
    let series = json!({ "names": [], "rows": [[1.0]] });
    assert_eq!(history, json!({ "track": [], "series": series, "said": [] }));
}

#[test]
fn each_message_comes_once_and_in_order() {
    let (page, _requests) = start();
    let (end, begin) = (AtomicBool::new(false), Instant::now());
    thread::scope(|scope| {
        scope.spawn(|| {
            let mut id = 0;
            while !end.load(Ordering::Relaxed) && begin.elapsed() < Duration::from_secs(30) {
                page.said(json!({ "id": id }).to_string());
                id += 1;
                thread::sleep(Duration::from_millis(2));
            }
        });
        let readers: Vec<_> = (0..20)
            .map(|_| {
                thread::sleep(Duration::from_millis(37));
                scope.spawn(|| {
                    let mut reader = Reader::open(&page).unwrap();
                    let history = reader.expect("history");
                    let mut ids: Vec<u64> = history["said"]
                        .as_array()
                        .unwrap()
                        .iter()
                        .map(|said| said["id"].as_u64().unwrap())
                        .collect();
                    while ids.len() < 600 {
                        ids.push(reader.expect("said")["id"].as_u64().unwrap());
                    }
                    ids
                })
            })
            .collect();
        for reader in readers {
            let ids = reader.join().unwrap();
            let next = |pair: &[u64]| pair[1] == pair[0] + 1;
            assert!(ids.windows(2).all(next), "{ids:?}");
        }
        end.store(true, Ordering::Relaxed);
    });
}

#[test]
fn the_state_is_the_newest() {
    let (page, _requests) = start();
    let mut reader = Reader::open(&page).unwrap();
    reader.expect("history");
    let begin = Instant::now();
    thread::scope(|scope| {
        scope.spawn(|| {
            for i in 0..300 {
                page.state(json!({ "n": i }).to_string());
                thread::sleep(Duration::from_millis(5));
            }
        });
        let mut seen = Vec::new();
        while seen.last() != Some(&299) {
            seen.push(reader.state()["n"].as_u64().unwrap());
        }
        let seconds = begin.elapsed().as_secs_f64();
        assert!(seen.windows(2).all(|pair| pair[0] < pair[1]));
        assert!(seen.len() as f64 <= 10.0 * seconds + 2.0, "{} in {seconds} s", seen.len());
        assert!(seen.len() >= 8, "{seen:?}");
    });
    // A new reader receives the newest state without waiting for another one.
    let mut other = Reader::open(&page).unwrap();
    other.expect("history");
    assert_eq!(other.expect("state"), json!({ "n": 299 }));
}

#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn silence_is_a_comment() {
    let (page, _requests) = start();
    let mut reader = Reader::open(&page).unwrap();
    reader.expect("history");
    let begin = Instant::now();
    assert_eq!(reader.expect(""), Value::Null);
    assert!((14.0..17.0).contains(&begin.elapsed().as_secs_f64()));
}

#[test]
fn readers_are_limited() {
    let (page, service) = served();
    let mut readers: Vec<Reader> = (0..32).map(|_| Reader::open(&page).unwrap()).collect();
    let refused = Reader::open(&page).err().unwrap();
    assert_eq!(refused.status, 503);
    assert!(refused.error().contains("32"));
    // Files and actions remain.
    assert_eq!(get(&page, "/").status, 200);
    assert_eq!(post(&page, &authorised(), STOP).status, 200);
    readers.truncate(31);
    thread::sleep(Duration::from_millis(300));
    readers.push(Reader::open(&page).unwrap());
    page.state("{}".to_owned());
    for reader in &mut readers {
        reader.state();
    }
    drop(page);
    service.join().unwrap();
}

/// Connections that the server holds open.
#[cfg(target_os = "linux")]
fn server_connections(page: &Page) -> usize {
    let links = std::fs::read_dir("/proc/self/fd").unwrap();
    let links = links.filter_map(|file| std::fs::read_link(file.unwrap().path()).ok());
    let files: std::collections::HashSet<String> =
        links.map(|link| link.to_string_lossy().into_owned()).collect();
    let text = std::fs::read_to_string("/proc/self/net/tcp").unwrap();
    let own = format!("0100007F:{:04X}", page.address().port());
    let is_open = |line: &&str| {
        let fields: Vec<&str> = line.split_whitespace().collect();
        let is_listening = fields[3] == "0A";
        fields[1] == own && !is_listening && files.contains(&format!("socket:[{}]", fields[9]))
    };
    text.lines().skip(1).filter(is_open).count()
}

#[test]
fn a_thousand_connections_change_nothing_for_the_others() {
    let (page, service) = served();
    let mut reader = Reader::open(&page).unwrap();
    reader.expect("history");
    let mut idle = Vec::new();
    #[cfg(target_os = "linux")]
    let mut most = 0;
    for i in 0..1000 {
        let mut stream = connect(&page);
        // Half of them send a part of a request.
        if i % 2 == 0 {
            let _ = stream.write_all(b"GET / HTTP/1.1\r\nHost: ");
        }
        idle.push(stream);
        if i % 100 == 99 {
            page.state(json!({ "n": i }).to_string());
            assert_eq!(reader.state()["n"], json!(i));
            let begin = Instant::now();
            assert_eq!(post(&page, &authorised(), STOP).status, 200);
            assert!(begin.elapsed() < Duration::from_secs(1));
            #[cfg(target_os = "linux")]
            {
                // All that wait have been accepted, so the two lists of the system belong together.
                thread::sleep(Duration::from_millis(100));
                let counts = (0..3).map(|_| server_connections(&page));
                most = most.max(counts.min().unwrap_or_default());
            }
        }
    }
    #[cfg(target_os = "linux")]
    assert!((32..=66).contains(&most), "{most} connections");
    // At once, from several threads.
    thread::scope(|scope| {
        for _ in 0..8 {
            scope.spawn(|| {
                for _ in 0..125 {
                    drop(TcpStream::connect(page.address()));
                }
            });
        }
    });
    page.state(json!({ "n": -1 }).to_string());
    assert_eq!(reader.state()["n"], json!(-1));
    drop(idle);
    assert_eq!(get(&page, "/").status, 200);
    drop(page);
    assert_eq!(service.join().unwrap().len(), 10);
}

#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn slow_downloads_do_not_keep_an_operator_out() {
    let (page, service) = served();
    let mut reader = Reader::open(&page).unwrap();
    reader.expect("history");
    let downloads: Vec<TcpStream> = (0..200)
        .map(|_| {
            let mut stream = connect(&page);
            let _ = stream.write_all(b"GET /large HTTP/1.1\r\nHost: localhost\r\n\r\n");
            stream
        })
        .collect();
    thread::sleep(Duration::from_millis(200));
    for i in 0..20 {
        assert_eq!(post(&page, &authorised(), STOP).status, 200);
        page.state(json!({ "n": i }).to_string());
        assert_eq!(reader.state()["n"], json!(i));
    }
    #[cfg(target_os = "linux")]
    {
        assert!((60..=66).contains(&server_connections(&page)));
        // They read nothing, and are dropped.
        thread::sleep(Duration::from_secs(12));
        assert!(server_connections(&page) <= 1);
    }
    drop(downloads);
    drop(page);
    service.join().unwrap();
}

#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn a_reader_that_does_not_read_is_dropped_alone() {
    let (page, _requests) = start();
    let mut reader = Reader::open(&page).unwrap();
    let slow = Reader::open(&page).unwrap();
    let (end, begin) = (AtomicBool::new(false), Instant::now());
    let padding = "x".repeat(100_000);
    thread::scope(|scope| {
        let service = scope.spawn(|| {
            let mut longest = Duration::ZERO;
            let mut i = 0;
            while !end.load(Ordering::Relaxed) && begin.elapsed() < Duration::from_secs(30) {
                let state = json!({ "n": i, "padding": padding }).to_string();
                let call = Instant::now();
                page.state(state);
                page.said(format!("{{\"id\":{i}}}"));
                page.track([0.0; 4]);
                longest = longest.max(call.elapsed());
                i += 1;
                thread::sleep(Duration::from_millis(10));
            }
            longest
        });
        // The other reader receives states all the time.
        let mut last = Instant::now();
        while begin.elapsed() < Duration::from_secs(16) {
            reader.state();
            assert!(last.elapsed() < Duration::from_secs(2));
            last = Instant::now();
        }
        end.store(true, Ordering::Relaxed);
        let longest = service.join().unwrap();
        assert!(longest < Duration::from_millis(200), "{longest:?}");
    });
    // What the system still holds comes, and then the connection is reset.
    let mut slow = slow;
    let mut states = 0;
    while let Some((name, _)) = slow.next() {
        states += usize::from(name == "state");
        assert!(begin.elapsed() < Duration::from_secs(30), "it is still connected");
    }
    assert!(states < 100, "{states}");
    #[cfg(target_os = "linux")]
    assert_eq!(server_connections(&page), 1);
}

#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn a_slow_reader_skips_states() {
    let (page, _requests) = start();
    let mut reader = Reader::open(&page).unwrap();
    reader.expect("history");
    let padding = "x".repeat(50_000);
    let mut counts = Vec::new();
    let begin = Instant::now();
    let mut i = 0;
    while begin.elapsed() < Duration::from_secs(8) {
        page.state(json!({ "n": i, "padding": padding }).to_string());
        page.said(json!({ "id": i }).to_string());
        i += 1;
        thread::sleep(Duration::from_millis(10));
    }
    page.state(json!({ "n": i }).to_string());
    let mut ids = Vec::new();
    while counts.last() != Some(&i) {
        match reader.next().unwrap() {
            (name, data) if name == "state" => counts.push(data["n"].as_u64().unwrap()),
            (_, data) => ids.push(data["id"].as_u64().unwrap()),
        }
    }
    // It jumps to the newest one, and messages that are kept are not lost.
    assert!(counts.windows(2).all(|pair| pair[0] < pair[1]));
    assert!(ids.windows(2).all(|pair| pair[0] < pair[1]));
    assert!((i - MAX_SAID as u64..i).all(|id| ids.contains(&id)));
    assert!(counts.len() < 80, "{}", counts.len());
}

#[test]
fn publishing_without_readers_takes_little_time() {
    let (page, _requests) = start();
    let begin = Instant::now();
    for i in 0..100_000 {
        page.state(format!("{{\"n\":{i}}}"));
        page.said(format!("{{\"id\":{i}}}"));
        page.track([0.0; 4]);
        page.series(0.0, &[1.0; 3], &[1.0; 3]);
    }
    let each = begin.elapsed() / 100_000;
    assert!(each < Duration::from_micros(100), "{each:?}");
}

#[test]
fn the_end_closes_all_connections_at_once() {
    let (page, requests) = start();
    let address = page.address();
    let mut readers: Vec<Reader> = (0..10).map(|_| Reader::open(&page).unwrap()).collect();
    let mut idle = connect(&page);
    let mut waiting = connect(&page);
    waiting.write_all(request(&page, &authorised(), STOP).as_bytes()).unwrap();
    let pending = requests.recv_timeout(Duration::from_secs(5)).unwrap();
    let begin = Instant::now();
    drop(page);
    assert!(begin.elapsed() < Duration::from_secs(1));
    for reader in &mut readers {
        while reader.next().is_some() {}
    }
    assert!(matches!(idle.read(&mut [0; 10]), Ok(0) | Err(_)));
    assert!(matches!(waiting.read(&mut [0; 10]), Ok(0) | Err(_)));
    assert!(!pending.reply.is_awaited());
    assert!(requests.recv().is_err());
    assert!(TcpStream::connect(address).is_err());
    // The address is free again.
    let (again, _requests) = Page::start(Options { address, ..options() }, &ASSETS).unwrap();
    assert_eq!(again.address(), address);
    assert_eq!(get(&again, "/").status, 200);
}

#[test]
fn an_address_in_use_is_an_error_at_the_start() {
    let (page, _requests) = start();
    let error = Page::start(Options { address: page.address(), ..options() }, &ASSETS).err().unwrap();
    assert_eq!(error.kind(), ErrorKind::AddrInUse);
    let all = SocketAddr::from(([0, 0, 0, 0], 0));
    let (page, _requests) = Page::start(Options { address: all, ..options() }, &ASSETS).unwrap();
    let own = SocketAddr::from(([127, 0, 0, 1], page.address().port()));
    let mut stream = TcpStream::connect(own).unwrap();
    stream.write_all(b"GET / HTTP/1.1\r\nHost: 10.0.0.7:8600\r\n\r\n").unwrap();
    let mut bytes = Vec::new();
    stream.read_to_end(&mut bytes).unwrap();
    assert_eq!(parse(&bytes).status, 200);
}
