use std::io::{Read as _, Write as _};
use std::net::{IpAddr, TcpListener};
use std::sync::mpsc::{Receiver, channel};

use super::target::is_public;
use super::*;

const SOON: Duration = Duration::from_secs(20);

fn secret() -> Secret {
    // The example of the specification.
    Secret::read("whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw").unwrap()
}

#[test]
fn signatures_are_those_of_the_specification() {
    let payload = r#"{"test": 2432232314}"#;
    let signature = secret().sign("msg_p5jXN8AQM9LWM0D4loKWxJek", 1_614_265_330, payload).unwrap();
    assert_eq!(signature, "v1,g0hM9SsE+OTPJTGt/tmIKtSyZlE3uFJELVlNIOLJ1OE=");
    for bad in ["", "MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw", "whsec_", "whsec_c2hvcnQ=", "whsec_?", "whsec_MfKQ9r8G KYqrTw"]
    {
        assert!(Secret::read(bad).is_none(), "{bad}");
    }
}

#[test]
fn addresses_of_private_networks_are_known() {
    let public =
        ["1.1.1.1", "93.184.216.34", "2606:4700::1111", "2002:101:101::1", "64:ff9b::1.1.1.1", "::ffff:1.1.1.1"];
    let private = [
        "0.0.0.0",
        "10.1.2.3",
        "100.64.0.1",
        "100.127.255.255",
        "127.0.0.1",
        "127.255.0.1",
        "169.254.169.254",
        "172.16.0.1",
        "172.31.255.255",
        "192.0.0.8",
        "192.168.1.1",
        "198.19.0.1",
        "203.0.113.9",
        "224.0.0.1",
        "255.255.255.255",
        "::",
        "::1",
        "::ffff:127.0.0.1",
        "::ffff:10.0.0.1",
        "fe80::1",
        "fc00::1",
        "fd12::1",
        "ff02::1",
        "2001::1",
        "2001:db8::1",
        "3fff::1",
        "64:ff9b::a00:1",
        "2002:7f00:1::",
        "2002:c0a8:101::",
        "fec0::1",
        "100::1",
        "::7f00:1",
    ];
    for address in public {
        assert!(is_public(address.parse::<IpAddr>().unwrap()), "{address}");
    }
    for address in private {
        assert!(!is_public(address.parse::<IpAddr>().unwrap()), "{address}");
    }
    assert_eq!(public.len() + private.len(), 38);
}

#[test]
fn addresses_of_webhooks_are_checked_when_they_come() {
    let long = format!("https://a.example/{}", "x".repeat(2000));
    for bad in [
        "",
        "a.example/x",
        "/x",
        "ftp://a.example/",
        "https:///x",
        "https://u:p@a.example/",
        "https://a.example/#x",
        "https://a.example:99999/",
        "https://a.example:x/",
        "https://a.example/ä",
        "https://a example/",
        "file:///etc",
        "javascript:alert(1)",
        "https://",
        &long,
    ] {
        assert_eq!(Target::read(bad, true), Err(BadTarget::Malformed), "{bad}");
    }
    for private in [
        "http://127.0.0.1/",
        "http://127.0.0.1:8080",
        "http://[::1]:80/x",
        "https://10.0.0.1/x",
        "http://localhost/",
        "http://LOCALHOST:9/",
        "http://a.localhost./",
        "http://169.254.169.254/latest/meta-data",
        "http://[::ffff:10.0.0.1]/",
    ] {
        assert_eq!(Target::read(private, false), Err(BadTarget::Private), "{private}");
        assert!(Target::read(private, true).is_ok(), "{private}");
    }
    let good = Target::read("https://CI.example:8443/hooks?x=1", false).unwrap();
    assert_eq!((good.host(), good.address()), ("ci.example", "https://CI.example:8443/hooks?x=1"));
}

/// A receiver that answers with these statuses, one after the other, and passes on what it got.
fn receiver(statuses: &'static [&'static str]) -> (String, Receiver<String>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("http://{}/hook", listener.local_addr().unwrap());
    let (sender, got) = channel();
    std::thread::spawn(move || {
        for status in statuses {
            let (mut stream, _) = listener.accept().unwrap();
            let mut text = Vec::new();
            let mut buffer = [0; 4096];
            while !text.ends_with(b"}") {
                let count = stream.read(&mut buffer).unwrap();
                assert!(count > 0, "{}", String::from_utf8_lossy(&text));
                text.extend(&buffer[..count]);
            }
            // Before the answer: what is settled has been received.
            sender.send(String::from_utf8(text).unwrap()).unwrap();
            write!(stream, "HTTP/1.1 {status}\r\nConnection: close\r\nContent-Length: 0\r\n\r\n").unwrap();
        }
    });
    (address, got)
}

/// Webhooks that may be sent to private addresses, and the ids of those that are settled.
fn webhooks(to_private: bool) -> (Webhooks, Receiver<String>) {
    let (sender, settled) = channel();
    let sender = Mutex::new(sender);
    let (retry, roots) = (Duration::from_millis(1), RootCerts::WebPki);
    let settings = WebhookSettings { secret: secret(), to_private, roots, retry, metrics: None };
    let settled_ids = Box::new(move |id: &str| _ = sender.lock().unwrap().send(id.to_owned()));
    (Webhooks::start(settings, settled_ids).unwrap(), settled)
}

fn delivery(id: &str, address: &str) -> Make {
    let delivery =
        Delivery { id: id.to_owned(), target: Target::stored(address).unwrap(), payload: r#"{"a":1}"#.to_owned() };
    Box::new(move || Some(delivery))
}

#[test]
fn what_fails_is_tried_again_under_the_same_id() {
    // The redirect is not followed: the next attempt comes to the same address.
    let (address, got) =
        receiver(&["500 Oops", "302 Found\r\nLocation: http://127.0.0.1:1/", "429 Later", "204 No Content"]);
    let (webhooks, settled) = webhooks(true);
    webhooks.send(delivery("one", &address));
    assert_eq!(settled.recv_timeout(SOON).unwrap(), "one");
    let texts: Vec<String> = got.try_iter().collect();
    assert_eq!(texts.len(), 4);
    for text in &texts {
        let header = |name: &str| {
            let line = text.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(": "));
            line.unwrap_or_else(|| panic!("no {name} in {text}"))
        };
        assert!(text.starts_with("POST /hook HTTP/1.1\r\n") && text.ends_with(r#"{"a":1}"#), "{text}");
        assert_eq!((header("webhook-id"), header("content-type")), ("one", "application/json"));
        let time = header("webhook-timestamp").parse().unwrap();
        assert_eq!(header("webhook-signature"), secret().sign("one", time, r#"{"a":1}"#).unwrap());
    }
    // It is settled a moment before it is counted.
    let began = Instant::now();
    while webhooks.count() != 0 {
        assert!(began.elapsed() < SOON, "{} wait", webhooks.count());
    }
}

#[test]
fn attempts_come_to_an_end() {
    let (webhooks, settled) = webhooks(true);
    // A port on which nobody listens.
    let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    webhooks.send(delivery("refused", &format!("http://127.0.0.1:{port}/")));
    // A pause of 1 ms grows to 4096 ms and a quarter.
    assert_eq!(settled.recv_timeout(SOON).unwrap(), "refused");
    let (address, got) = receiver(&["410 Gone"]);
    webhooks.send(delivery("gone", &address));
    assert_eq!(settled.recv_timeout(SOON).unwrap(), "gone");
    assert_eq!(got.try_iter().count(), 1);
    assert!((pause(Duration::from_secs(5), 8)) >= Duration::from_secs(5 * 4_u64.pow(7)));
    assert!((pause(Duration::from_secs(86_400), 8)) <= Duration::from_secs(86_400));
}

#[test]
fn a_name_that_turns_out_to_be_private_is_not_connected_to() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    listener.set_nonblocking(true).unwrap();
    let port = listener.local_addr().unwrap().port();
    let (webhooks, settled) = webhooks(false);
    // The check of names sees numbers and `localhost` alone; the lookup sees the rest.
    let hosts = ["localhost", "127.0.0.1", "2130706433", "0x7f.1", "127.1", "[::1]", "[::ffff:127.0.0.1]"];
    for host in hosts {
        webhooks.send(delivery(host, &format!("http://{host}:{port}/")));
    }
    let mut ended: Vec<String> = hosts.iter().map(|_| settled.recv_timeout(SOON).unwrap()).collect();
    ended.sort();
    assert_eq!(ended.len(), hosts.len());
    assert_eq!(listener.accept().err().map(|error| error.kind()), Some(std::io::ErrorKind::WouldBlock));
}

#[test]
fn a_silent_receiver_leaves_threads_to_others() {
    // It accepts by its backlog and answers nothing.
    let silent = TcpListener::bind("127.0.0.2:0").unwrap();
    let (address, _got) = receiver(&["200 OK"; 20]);
    let (webhooks, settled) = webhooks(true);
    for number in 0..20 {
        webhooks.send(delivery(&format!("silent {number}"), &format!("http://{}/", silent.local_addr().unwrap())));
    }
    let began = Instant::now();
    for number in 0..20 {
        webhooks.send(delivery(&format!("{number}"), &address));
    }
    for _ in 0..20 {
        let id = settled.recv_timeout(SOON).unwrap();
        assert!(!id.starts_with("silent"), "{id}");
    }
    assert!(began.elapsed() < Duration::from_secs(8), "{:?}", began.elapsed());
    assert!(webhooks.count() >= 18);
    webhooks.close();
}
