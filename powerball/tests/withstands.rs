//! What the process that holds an arm withstands, and what happens on the bus where it dies: hostile requests
//! to its page, SIGKILL, an abort.

#![cfg(target_os = "linux")]
#![allow(clippy::unwrap_used, clippy::panic)]

mod true_model;

use powerball::bus::canopen::{Cob, Frame};
use powerball::bus::driver::lwa4p::LWA4P;
use powerball::bus::transport::{self, Event};
use serde_json::{Value, json};
use std::f64::consts::TAU;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};
use true_model::true_model;

const ARM: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/lwa4p.toml");

fn powerball(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_powerball"));
    command.args(arguments).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// A fresh folder with the virtual arm's true model, and a path of `seconds` from rest to rest.
fn folder(name: &str, seconds: f64) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    let model = true_model(1.0, json!([]));
    std::fs::write(folder.join("model.json"), model.to_string()).unwrap();
    let mut text = String::from("t,q1,q2,q3,q4,q5,q6\n");
    for k in 0..=(200.0 * seconds) as u32 {
        let t = 0.005 * f64::from(k);
        let q = 0.3 * (1.0 - (TAU * t / 6.0).cos());
        text += &format!("{t:.6},{q},{q},{},{q},{q},{q}\n", -q);
    }
    std::fs::write(folder.join("path.csv"), text).unwrap();
    folder
}

/// `powerball follow --with torque` along that path.
fn follow(folder: &Path, out: &str, more: &[&str]) -> Command {
    let [model, path, out] = ["model.json", "path.csv", out].map(|f| folder.join(f).display().to_string());
    let base = ["follow", "--arm", ARM, "--floor", "none", "--with", "torque"];
    let files = ["--model", &model, "--trajectory", &path, "--out", &out];
    powerball(&[&base[..], &files, more].concat())
}

/// Megabytes that a process has had at most.
fn peak(child: &Child) -> Option<f64> {
    let status = std::fs::read_to_string(format!("/proc/{}/status", child.id())).ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM"))?;
    Some(line.split_whitespace().nth(1)?.parse::<f64>().ok()? / 1e3)
}

/// Sends bytes, and reads what comes in a second or until the other side closes or falls silent.
fn exchange(at: SocketAddr, bytes: &[u8]) -> String {
    let mut stream = TcpStream::connect(at).unwrap();
    stream.set_read_timeout(Some(Duration::from_millis(700))).unwrap();
    let _ = stream.write_all(bytes);
    let mut answer = Vec::new();
    let (mut part, began) = ([0; 4096], Instant::now());
    while began.elapsed() < Duration::from_secs(1)
        && let Ok(n @ 1..) = stream.read(&mut part)
    {
        answer.extend_from_slice(&part[..n]);
    }
    String::from_utf8_lossy(&answer).into_owned()
}

/// Everything that a page must not do is tried on the page of an arm that moves. The run is the one that
/// nobody disturbs.
#[test]
fn a_page_can_do_nothing_to_the_arm() {
    let folder = folder("hostile", 12.0);
    let quiet = follow(&folder, "quiet", &[]).output().unwrap();
    assert!(quiet.status.success(), "{}", String::from_utf8_lossy(&quiet.stderr));

    let mut run = follow(&folder, "served", &["--serve", "127.0.0.1:0"]).spawn().unwrap();
    let mut said = BufReader::new(run.stderr.take().unwrap()).lines();
    let address = said.find_map(|line| line.unwrap().split_once("http://").map(|a| a.1.to_string())).unwrap();
    let (place, query) = address.split_once('/').unwrap();
    let at: SocketAddr = place.parse().unwrap();
    assert!(query.starts_with("?token=") && query.len() == 7 + 32, "{address}");
    let get = |target: &str, headers: &str| {
        exchange(at, format!("GET {target} HTTP/1.1\r\n{headers}\r\n\r\n").as_bytes())
    };
    let host = format!("Host: {at}");
    let page = format!("/{query}");
    let events = format!("/events{query}");
    let status = |answer: &str| answer.get(9..12).unwrap_or_default().to_string();

    // Who has the address sees the page, and what happens from the beginning on.
    let whole = get(&page, &host);
    assert!(whole.starts_with("HTTP/1.1 200") && whole.ends_with("</html>\n"), "{whole:.300}");
    let fed = get(&events, &host);
    assert!(
        fed.contains("data: {") && fed.contains("\"kind\":\"start\"") && fed.contains("\"sample\""),
        "{fed:.300}"
    );
    let before = peak(&run).unwrap();

    // Names, origins, tokens.
    for (target, headers, expected) in [
        (page.as_str(), format!("Host: localhost:{}", at.port()), "200"),
        (&page, format!("{host}\r\nOrigin: http://{at}"), "200"),
        (&page, "Host: arm.example.com".to_string(), "403"),
        (&page, format!("Host: arm.example.com:{}", at.port()), "403"),
        (&page, "X: y".to_string(), "403"),
        (&page, format!("{host}\r\nHost: arm.example.com"), "403"),
        (&format!("http://arm.example.com{page}"), host.clone(), "403"),
        (&page, format!("{host}\r\nOrigin: http://arm.example.com"), "403"),
        (&page, format!("{host}\r\nOrigin: null"), "403"),
        ("/", host.clone(), "403"),
        ("/events", host.clone(), "403"),
        ("/events?token=00000000000000000000000000000000", host.clone(), "403"),
        (&format!("/elsewhere{query}"), host.clone(), "404"),
        (&page, format!("{host}\r\nContent-Length: 999999999999"), "413"),
        (&page, format!("{host}\r\nTransfer-Encoding: chunked"), "413"),
    ] {
        assert_eq!(status(&get(target, &headers)), expected, "{target} with {headers}");
    }
    let post = format!("POST {page} HTTP/1.1\r\n{host}\r\nContent-Length: 999999999999\r\n\r\n");
    let refused = exchange(at, post.as_bytes());
    assert!(status(&refused) == "405" && refused.to_lowercase().contains("allow: get"), "{refused}");
    assert_eq!(status(&exchange(at, &[0; 100])), "400");

    // Many requests at once get one answer.
    let piped = format!("GET {page} HTTP/1.1\r\n{host}\r\n\r\n").repeat(2000);
    assert!(exchange(at, piped.as_bytes()).matches("HTTP/1.1 ").count() <= 1);

    // A header without an end is cut off early.
    let mut endless = TcpStream::connect(at).unwrap();
    endless.set_write_timeout(Some(Duration::from_secs(1))).unwrap();
    endless.write_all(b"GET / HTTP/1.1\r\nX: ").unwrap();
    let mut taken = 0;
    while taken < 200_000_000 && endless.write_all(&[b'a'; 65_536]).is_ok() {
        taken += 65_536;
    }
    assert!(taken < 20_000_000, "{taken} bytes of a header were taken");

    // Readers that take nothing, and half of a request a hundred times over; then there is room again.
    let idle: Vec<TcpStream> = (0..100)
        .map(|k| {
            let mut stream = TcpStream::connect(at).unwrap();
            let half = format!("GET {events} HTTP/1.1\r\n{host}\r\n");
            let _ = stream.write_all(half.as_bytes());
            if k < 5 {
                let _ = stream.write_all(b"\r\n");
            }
            stream
        })
        .collect();
    assert!(run.try_wait().unwrap().is_none());
    std::thread::sleep(Duration::from_millis(3500));
    assert_eq!(status(&get(&page, &host)), "200");
    assert!(run.try_wait().unwrap().is_none(), "the attack took longer than the run");

    let mut after = before;
    let ended = loop {
        after = peak(&run).map_or(after, |mb| mb.max(after));
        if let Some(ended) = run.try_wait().unwrap() {
            break ended;
        }
        std::thread::sleep(Duration::from_millis(5));
    };
    drop(idle);
    let rest: Vec<String> = said.map_while(Result::ok).collect();
    assert!(ended.success(), "{rest:?}");
    println!("memory: {before:.1} MB before the attack, {after:.1} MB at most");
    assert!(after - before < 20.0, "{before} MB before, {after} MB at most");
    let result = |out: &str| std::fs::read_to_string(folder.join(out).join("follow.json")).unwrap();
    assert_eq!(result("quiet"), result("served"));
}

/// A program that ends with the test.
struct Ended(Child);

impl Drop for Ended {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// All frames of a bus, as they come.
fn listen(url: &str) -> Receiver<(Instant, Frame)> {
    let (url, (send, heard)) = (url.parse().unwrap(), channel());
    let (ready, opened) = channel();
    std::thread::spawn(move || {
        let mut bus = transport::open(&url).unwrap();
        ready.send(()).unwrap();
        loop {
            let until = bus.now() + 100_000;
            if let Some((_, Event::Frame(frame))) = bus.receive(until).unwrap()
                && send.send((Instant::now(), frame)).is_err()
            {
                return;
            }
        }
    });
    opened.recv().unwrap();
    heard
}

/// Processes with this among their arguments.
fn running_with(argument: &str) -> Vec<String> {
    let processes = std::fs::read_dir("/proc").unwrap().filter_map(Result::ok);
    let has = |id: &String| {
        let line = std::fs::read(format!("/proc/{id}/cmdline")).unwrap_or_default();
        let words: Vec<&[u8]> = line.split(|b| *b == 0).collect();
        words.contains(&argument.as_bytes()) && words.contains(&b"--watchdog".as_slice())
    };
    processes.map(|p| p.file_name().to_string_lossy().into_owned()).filter(has).collect()
}

fn signal(name: &str, process: &str) {
    assert!(Command::new("kill").args([name, process]).status().unwrap().success());
}

/// `bus stop`'s first frame: all nodes leave operational.
fn leaves_operational(frame: &Frame) -> bool {
    Cob::of(frame) == Some(Cob::Nmt) && frame.bytes() == [0x80, 0]
}

/// The joint whose drive is commanded to stop quickly by this frame, an SDO to 0x6040.
fn quick_stop(frame: &Frame) -> Option<usize> {
    let of =
        |joint: &powerball::bus::driver::JointProfile| Cob::of(frame) == Some(Cob::SdoRequest(joint.node));
    LWA4P.joints.iter().position(of).filter(|_| frame.bytes() == [0x2B, 0x40, 0x60, 0, 2, 0, 0, 0])
}

/// The current that a joint is commanded while it is enabled in current mode.
fn current(frame: &Frame) -> bool {
    matches!(Cob::of(frame), Some(Cob::Rpdo(1, _))) && matches!(frame.bytes(), [0x0F, 0, _, _])
}

/// A run that has been in torque mode for a second. A machine with other work may leave it without time for
/// its cycle: then the driver stops the arm, and it is tried again.
fn in_torque_mode(folder: &Path, url: &str, heard: &Receiver<(Instant, Frame)>) -> Ended {
    let mut why = String::new();
    for _ in 0..5 {
        let mut run = Ended(follow(folder, "out", &["--bus", url, "--accept-unverified"]).spawn().unwrap());
        let mut commands = 0;
        while run.0.try_wait().unwrap().is_none() {
            let Ok((_, frame)) = heard.recv_timeout(Duration::from_millis(100)) else { continue };
            assert!(!leaves_operational(&frame) && quick_stop(&frame).is_none(), "it spoke too early");
            commands += usize::from(current(&frame));
            if commands >= 1200 {
                return run;
            }
        }
        run.0.stderr.take().unwrap().read_to_string(&mut why).unwrap();
    }
    panic!("no run came to its torque mode: {why}")
}

#[test]
fn a_process_that_is_killed_in_motion_leaves_a_stop_on_the_bus() {
    let folder = folder("killed_in_motion", 60.0);
    for (k, name) in ["-KILL", "-ABRT"].into_iter().enumerate() {
        let url = format!("udp:239.74.163.2:{}", 43200 + (std::process::id() as usize + 2 * k) % 20000);
        let _arm = Ended(
            powerball(&["virtual-arm", "--bus", &url, "--current-mode", "--commutated", "--for", "100"])
                .spawn()
                .unwrap(),
        );
        let heard = listen(&url);
        std::thread::sleep(Duration::from_millis(500));
        let mut run = in_torque_mode(&folder, &url, &heard);
        // What ends both does not end the watchdog first.
        let watchdogs = running_with(&url);
        assert_eq!(watchdogs.len(), 1);
        for harmless in ["-INT", "-TERM", "-HUP"] {
            signal(harmless, &watchdogs[0]);
        }
        let killed = Instant::now();
        signal(name, &run.0.id().to_string());
        let mut stopped = [None; 6];
        let mut left = None;
        while stopped.contains(&None) {
            let (at, frame) = heard.recv_timeout(Duration::from_secs(5)).unwrap();
            let passed = at.saturating_duration_since(killed);
            if leaves_operational(&frame) {
                left.get_or_insert(passed);
            }
            if let Some(j) = quick_stop(&frame) {
                stopped[j].get_or_insert(passed);
            }
        }
        let slowest = stopped.into_iter().flatten().max().unwrap();
        println!("{name}: out of operational after {left:?}, all joints commanded to stop after {slowest:?}");
        assert!(left.unwrap() <= slowest && slowest < Duration::from_millis(100), "{slowest:?}");
        assert!(!run.0.wait().unwrap().success());
        // It says so, ends, and the arm has no torque.
        let until = Instant::now() + Duration::from_secs(10);
        while !running_with(&url).is_empty() {
            assert!(Instant::now() < until, "the watchdog stays");
            std::thread::sleep(Duration::from_millis(20));
        }
        let mut said = String::new();
        run.0.stderr.take().unwrap().read_to_string(&mut said).unwrap();
        assert!(said.contains("has died"), "{said}");
        let state = powerball(&["bus", "state", "--bus", &url, "--json"]).output().unwrap();
        let state: Value = serde_json::from_slice(&state.stdout).unwrap();
        for node in state["nodes"].as_array().unwrap() {
            let state = node["state"].as_str().unwrap();
            assert!(state == "switch on disabled" || state == "fault", "{node}");
        }
    }
}

/// A command that ends in order has its watchdog end, and that one says nothing.
#[test]
fn a_watchdog_is_silent_where_the_arm_came_to_rest() {
    let url = format!("udp:239.74.163.2:{}", 43200 + (std::process::id() + 7777) % 20000);
    let _arm =
        Ended(powerball(&["virtual-arm", "--bus", &url, "--commutated", "--for", "60"]).spawn().unwrap());
    let heard = listen(&url);
    std::thread::sleep(Duration::from_millis(500));
    let held = powerball(&["bus", "enable", "--hold", "0.5", "--bus", &url]).output().unwrap();
    assert!(held.status.success(), "{}", String::from_utf8_lossy(&held.stderr));
    assert!(running_with(&url).is_empty());
    std::thread::sleep(Duration::from_millis(300));
    let frames: Vec<Frame> = heard.try_iter().map(|(_, frame)| frame).collect();
    assert!(frames.len() > 500 && frames.iter().all(|f| !leaves_operational(f) && quick_stop(f).is_none()));
}
