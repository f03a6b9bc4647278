//! Who may ask: protection against DNS rebinding and requests of other sites, and the token.

use std::hint;
use std::net::{Ipv4Addr, Ipv6Addr};

use axum::http::header::{AUTHORIZATION, HOST, HeaderMap, HeaderName, ORIGIN};

const SEC_FETCH_SITE: HeaderName = HeaderName::from_static("sec-fetch-site");

/// The only value of a header; `None` if it is missing, sent twice or not text.
fn only<'a>(headers: &'a HeaderMap, name: &HeaderName) -> Option<&'a str> {
    let mut values = headers.get_all(name).iter();
    let value = values.next()?.to_str().ok()?;
    values.next().is_none().then_some(value)
}

/// The host with its port to which a request is addressed.
pub(super) fn host(headers: &HeaderMap) -> Option<&str> {
    only(headers, &HOST)
}

/// Whether a host is an IP address, `localhost` or one of the names. Another site can let its own name point to this
/// computer (DNS rebinding), but these hosts never belong to it.
pub(super) fn is_own(host: &str, names: &[String]) -> bool {
    let (own, port) =
        if let Some((address, port)) = host.strip_prefix('[').and_then(|rest| rest.split_once(']')) {
            let port = if port.is_empty() { Some("80") } else { port.strip_prefix(':') };
            (address.parse::<Ipv6Addr>().is_ok(), port.unwrap_or_default())
        } else {
            let (name, port) = host.split_once(':').unwrap_or((host, "80"));
            let name = name.strip_suffix('.').unwrap_or(name);
            let is_name = |own: &str| name.eq_ignore_ascii_case(own);
            let own = is_name("localhost") || names.iter().any(|own| is_name(own));
            (own || name.parse::<Ipv4Addr>().is_ok(), port)
        };
    own && port.bytes().all(|digit| digit.is_ascii_digit()) && port.parse::<u16>().is_ok()
}

/// Whether a browser sends a request for a page of another site. Other programs send neither header.
pub(super) fn is_cross_site(headers: &HeaderMap) -> bool {
    let site = headers.contains_key(SEC_FETCH_SITE).then(|| only(headers, &SEC_FETCH_SITE));
    let same_site = match site {
        None | Some(Some("none")) => false,
        Some(Some("same-origin")) => true,
        Some(_) => return true,
    };
    if !headers.contains_key(ORIGIN) {
        return false;
    }
    match (only(headers, &ORIGIN), host(headers)) {
        // Some requests of a page without referrer.
        (Some("null"), _) => !same_site,
        (Some(origin), Some(host)) => {
            let authority = origin.strip_prefix("http://").or_else(|| origin.strip_prefix("https://"));
            !authority.is_some_and(|authority| authority.eq_ignore_ascii_case(host))
        }
        _ => true,
    }
}

/// Whether a request has the token.
pub(super) fn has_token(headers: &HeaderMap, token: &str) -> bool {
    let sent = only(headers, &AUTHORIZATION).and_then(|value| value.split_once(' '));
    sent.is_some_and(|(scheme, sent)| scheme.eq_ignore_ascii_case("bearer") && is_equal(sent.trim(), token))
}

/// Comparison whose time does not depend on the place of the first difference.
fn is_equal(sent: &str, token: &str) -> bool {
    let pairs = sent.bytes().zip(token.bytes());
    let difference = pairs.fold(0, |difference, (a, b)| hint::black_box(difference | (a ^ b)));
    sent.len() == token.len() && difference == 0
}
