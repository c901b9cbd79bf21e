//! Which requests are answered: `Host`, `Origin` and token.
//!
//! | attack                                                   | what refuses it                                     |
//! |----------------------------------------------------------|-----------------------------------------------------|
//! | another site's page posts to the server                  | `Origin` differs from `Host`                        |
//! | another site's page reads from the server                | no CORS header is sent, and `Sec-Fetch-Site`        |
//! | a name that the attacker owns is made to lead here (DNS) | `Host` is a name that the server does not have      |
//! | somebody else on the network                             | the token, without which only loopback is served    |

use std::net::{IpAddr, SocketAddr};

use axum::http::{HeaderMap, Method, header};

/// Shortest token, in bytes.
pub const MIN_TOKEN: usize = 16;

/// A secret that a page must know.
#[derive(Clone)]
pub struct Token(String);

/// A token is too short, or has characters that a header cannot carry.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a token has at least {MIN_TOKEN} letters and digits of ASCII")]
pub struct TokenError;

impl Token {
    /// The token of this text.
    ///
    /// # Errors
    ///
    /// The text is shorter than [`MIN_TOKEN`] or has other characters than letters and digits of ASCII, `-` and `_`.
    pub fn new(text: &str) -> Result<Self, TokenError> {
        let is_plain = text.bytes().all(|byte| byte.is_ascii_alphanumeric() || matches!(byte, b'-' | b'_'));
        if text.len() >= MIN_TOKEN && is_plain { Ok(Self(text.into())) } else { Err(TokenError) }
    }

    /// Whether this is the token, in a time that does not depend on the first byte that differs.
    fn is(&self, given: &[u8]) -> bool {
        let differing = self.0.bytes().zip(given).fold(0, |differing, (own, given)| differing | (own ^ given));
        self.0.len() == given.len() && differing == 0
    }
}

/// Whom the server answers.
#[derive(Clone)]
pub struct Access {
    is_loopback: bool,
    names: Vec<String>,
    token: Option<Token>,
}

/// Why the server does not start.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum AccessError {
    /// Everybody on the network could move the arm.
    #[error("{address} can be reached from the network: set a token of at least {MIN_TOKEN} characters by DARM_TOKEN")]
    NoToken {
        /// The address.
        address: SocketAddr,
    },
}

/// Why a request is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Denied {
    /// `Host` is missing or names another server.
    #[error("this server does not have the name that the request gives it; add it by --name")]
    Host,
    /// The request comes from the page of another site.
    #[error("the request comes from a page of another site")]
    Origin,
    /// The token is missing or wrong.
    #[error("the token is missing or wrong; open the address that `darm serve` printed")]
    Token,
}

impl Access {
    /// Access to a server at `address`, which has these names besides its numbers.
    ///
    /// # Errors
    ///
    /// The address is not loopback and there is no token.
    pub fn new(address: SocketAddr, names: Vec<String>, token: Option<Token>) -> Result<Self, AccessError> {
        let is_loopback = address.ip().is_loopback();
        if !is_loopback && token.is_none() {
            return Err(AccessError::NoToken { address });
        }
        Ok(Self { is_loopback, names, token })
    }

    /// Checks a request. Pages and scripts hold no secrets; what is below `/api/` needs the token.
    ///
    /// # Errors
    ///
    /// The request names another server, comes from another site's page, or has no token where one is needed.
    pub fn check(&self, method: &Method, path: &str, headers: &HeaderMap) -> Result<(), Denied> {
        let host = text(headers, header::HOST.as_str()).filter(|host| self.has_name(host)).ok_or(Denied::Host)?;
        let is_api = path.starts_with("/api/");
        let is_own = |origin: &str| {
            let authority = origin.strip_prefix("http://").or_else(|| origin.strip_prefix("https://"));
            authority.is_some_and(|authority| authority.eq_ignore_ascii_case(host))
        };
        if headers.contains_key(header::ORIGIN) && !text(headers, header::ORIGIN.as_str()).is_some_and(is_own) {
            return Err(Denied::Origin);
        }
        let site = text(headers, "sec-fetch-site").unwrap_or("none");
        if (is_api || method != Method::GET) && !matches!(site, "same-origin" | "none") {
            return Err(Denied::Origin);
        }
        match &self.token {
            Some(token) if is_api && !bearer(headers).is_some_and(|given| token.is(given)) => Err(Denied::Token),
            _ => Ok(()),
        }
    }

    /// Any port: a tunnel has another one than the server.
    fn has_name(&self, host: &str) -> bool {
        let name = match host.rsplit_once(':') {
            Some((name, port)) if !port.is_empty() && port.bytes().all(|byte| byte.is_ascii_digit()) => name,
            _ => host,
        };
        let bare = name.strip_prefix('[').and_then(|name| name.strip_suffix(']')).unwrap_or(name);
        match bare.parse::<IpAddr>() {
            Ok(number) => number.is_loopback() || !self.is_loopback,
            Err(_) => {
                name.eq_ignore_ascii_case("localhost") || self.names.iter().any(|own| own.eq_ignore_ascii_case(name))
            }
        }
    }
}

fn text<'h>(headers: &'h HeaderMap, name: &str) -> Option<&'h str> {
    headers.get(name)?.to_str().ok()
}

fn bearer(headers: &HeaderMap) -> Option<&[u8]> {
    headers.get(header::AUTHORIZATION)?.as_bytes().strip_prefix(b"Bearer ")
}

#[cfg(test)]
mod tests {
    use axum::http::{HeaderMap, HeaderName, HeaderValue, Method};

    use super::{Access, AccessError, Denied, Token};

    const SECRET: &str = "0123456789abcdef";

    fn headers(pairs: &[(&'static str, &'static str)]) -> HeaderMap {
        let pair = |(name, value): &(&'static str, &'static str)| {
            (HeaderName::from_static(name), HeaderValue::from_static(value))
        };
        pairs.iter().map(pair).collect()
    }

    fn loopback() -> Access {
        Access::new("127.0.0.1:8420".parse().unwrap(), vec!["bench".into()], None).unwrap()
    }

    fn check(access: &Access, pairs: &[(&'static str, &'static str)]) -> Result<(), Denied> {
        access.check(&Method::POST, "/api/stop", &headers(pairs))
    }

    #[test]
    fn only_the_names_of_the_server_are_hosts() {
        for host in ["127.0.0.1:8420", "localhost:9000", "[::1]:8420", "127.0.0.1", "bench:8420", "Bench"] {
            assert_eq!(check(&loopback(), &[("host", host)]), Ok(()), "{host}");
        }
        for host in ["evil.example:8420", "127.0.0.1.evil.example", "10.0.0.7:8420", "", "localhost.evil:8420", ":8420"]
        {
            assert_eq!(check(&loopback(), &[("host", host)]), Err(Denied::Host), "{host}");
        }
        assert_eq!(check(&loopback(), &[]), Err(Denied::Host));
    }

    #[test]
    fn only_its_own_pages_may_ask() {
        let host = ("host", "127.0.0.1:8420");
        assert_eq!(check(&loopback(), &[host, ("origin", "http://127.0.0.1:8420")]), Ok(()));
        for origin in ["http://evil.example", "http://127.0.0.1:8421", "http://localhost:8420", "null", ""] {
            assert_eq!(check(&loopback(), &[host, ("origin", origin)]), Err(Denied::Origin), "{origin}");
        }
        for site in ["cross-site", "same-site"] {
            assert_eq!(check(&loopback(), &[host, ("sec-fetch-site", site)]), Err(Denied::Origin), "{site}");
            let page = headers(&[host, ("sec-fetch-site", site)]);
            assert_eq!(loopback().check(&Method::GET, "/", &page), Ok(()), "a link leads to a page");
            assert_eq!(loopback().check(&Method::GET, "/api/live", &page), Err(Denied::Origin));
        }
    }

    #[test]
    fn beyond_loopback_the_token_is_needed() {
        let address = "0.0.0.0:8420".parse().unwrap();
        assert_eq!(Access::new(address, vec![], None).err(), Some(AccessError::NoToken { address }));
        let access = Access::new(address, vec![], Some(Token::new(SECRET).unwrap())).unwrap();
        let host = ("host", "10.0.0.7:8420");
        assert_eq!(check(&access, &[host, ("authorization", "Bearer 0123456789abcdef")]), Ok(()));
        for wrong in ["Bearer 0123456789abcdeF", "Bearer 0123456789abcde", "Bearer ", "0123456789abcdef"] {
            assert_eq!(check(&access, &[host, ("authorization", wrong)]), Err(Denied::Token), "{wrong}");
        }
        assert_eq!(check(&access, &[host]), Err(Denied::Token));
        assert_eq!(access.check(&Method::GET, "/program", &headers(&[host])), Ok(()), "a page holds no secret");
    }

    #[test]
    fn a_token_is_long_and_plain() {
        assert!(
            Token::new("short").is_err() && Token::new("0123456789abcdef\n").is_err() && Token::new(SECRET).is_ok()
        );
    }
}
