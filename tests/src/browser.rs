//! A real browser: Debian's chromium, headless, driven over its debugging protocol.

use std::fs;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use serde_json::{Value, json};
use tungstenite::protocol::Role;
use tungstenite::{Message, WebSocket};

/// A running browser; closed on drop.
pub struct Browser {
    child: Child,
    socket: WebSocket<TcpStream>,
    next: u64,
    /// Errors reported by pages: exceptions, refused scripts, failed requests.
    faults: Vec<String>,
    _profile: tempfile::TempDir,
}

/// An open page.
#[derive(Debug, Clone)]
pub struct Page {
    session: String,
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Makes a WebSocket of a connection to this machine (RFC 6455, 4.1). `tungstenite` could do this, but it requires
/// features of dependencies that `host-fit` alone does not use, and `host-fit` would be compiled twice.
fn upgrade(stream: &mut TcpStream, port: &str, path: &str) -> Result<()> {
    write!(
        stream,
        "GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\
         Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: MDEyMzQ1Njc4OWFiY2RlZg==\r\n\r\n"
    )?;
    // Reads exactly to the end of the header, because frames follow.
    let mut answer = Vec::new();
    while !answer.ends_with(b"\r\n\r\n") {
        let mut byte = [0];
        stream.read_exact(&mut byte)?;
        answer.extend(byte);
    }
    let answer = String::from_utf8_lossy(&answer);
    if !answer.starts_with("HTTP/1.1 101") {
        bail!("chromium refuses: {answer}");
    }
    Ok(())
}

impl Browser {
    /// Starts chromium.
    ///
    /// # Errors
    /// If it is not installed (`cargo xtask setup` installs it) or does not answer.
    pub fn start() -> Result<Self> {
        let profile = tempfile::tempdir()?;
        let child = Command::new("chromium")
            .args([
                "--headless=new",
                "--no-sandbox",
                "--disable-gpu",
                // Containers have a small `/dev/shm`.
                "--disable-dev-shm-usage",
                "--no-first-run",
            ])
            .args([
                "--remote-debugging-port=0",
                "--hide-scrollbars",
                "about:blank",
            ])
            .arg(format!("--user-data-dir={}", profile.path().display()))
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .context("chromium is missing; run `cargo xtask setup`")?;
        let told = profile.path().join("DevToolsActivePort");
        let started = Instant::now();
        let (port, path) = loop {
            let text = fs::read_to_string(&told).unwrap_or_default();
            let mut lines = text.lines();
            if let (Some(port), Some(path)) = (lines.next(), lines.next()) {
                break (port.to_owned(), path.to_owned());
            }
            if started.elapsed() > Duration::from_secs(60) {
                bail!("chromium does not start");
            }
            std::thread::sleep(Duration::from_millis(50));
        };
        let mut stream = TcpStream::connect(format!("127.0.0.1:{port}"))?;
        stream.set_read_timeout(Some(Duration::from_secs(120)))?;
        upgrade(&mut stream, &port, &path)?;
        Ok(Self {
            child,
            socket: WebSocket::from_raw_socket(stream, Role::Client, None),
            next: 0,
            faults: Vec::new(),
            _profile: profile,
        })
    }

    fn call(&mut self, session: Option<&str>, method: &str, params: &Value) -> Result<Value> {
        self.next += 1;
        let id = self.next;
        let mut request = json!({"id": id, "method": method, "params": params});
        if let Some(session) = session {
            request["sessionId"] = session.into();
        }
        self.socket.send(Message::text(request.to_string()))?;
        loop {
            let message = self.socket.read()?;
            let Ok(text) = message.to_text() else {
                continue;
            };
            let Ok(answer) = serde_json::from_str::<Value>(text) else {
                continue;
            };
            if answer["id"] == id {
                if let Some(error) = answer.get("error") {
                    bail!("{method}: {error}");
                }
                return Ok(answer["result"].clone());
            }
            let params = &answer["params"];
            match answer["method"].as_str() {
                Some("Runtime.exceptionThrown") => {
                    let details = &params["exceptionDetails"];
                    self.faults.push(format!(
                        "{} {}",
                        details["text"], details["exception"]["description"]
                    ));
                }
                Some("Log.entryAdded") if params["entry"]["level"] == "error" => {
                    self.faults.push(params["entry"]["text"].to_string());
                }
                _ => {}
            }
        }
    }

    /// Errors reported by pages since the last call.
    pub fn faults(&mut self) -> Vec<String> {
        std::mem::take(&mut self.faults)
    }

    /// Opens a page of this size, px.
    ///
    /// # Errors
    /// When the browser does not.
    pub fn open(&mut self, address: &str, (width, height): (u32, u32), dark: bool) -> Result<Page> {
        let target = self.call(None, "Target.createTarget", &json!({"url": "about:blank"}))?;
        let attach = json!({"targetId": target["targetId"], "flatten": true});
        let attached = self.call(None, "Target.attachToTarget", &attach)?;
        let session = attached["sessionId"]
            .as_str()
            .context("a session")?
            .to_owned();
        let page = Page { session };
        for domain in ["Runtime.enable", "Log.enable", "Page.enable"] {
            self.on(&page, domain, &json!({}))?;
        }
        // Measures the time of the page's own thread, which is independent of the machine's load.
        self.on(
            &page,
            "Performance.enable",
            &json!({"timeDomain": "threadTicks"}),
        )?;
        let size =
            json!({"width": width, "height": height, "deviceScaleFactor": 1, "mobile": false});
        self.on(&page, "Emulation.setDeviceMetricsOverride", &size)?;
        let scheme = if dark { "dark" } else { "light" };
        let media = json!({"features": [{"name": "prefers-color-scheme", "value": scheme}]});
        self.on(&page, "Emulation.setEmulatedMedia", &media)?;
        self.on(&page, "Page.navigate", &json!({"url": address}))?;
        self.wait(&page, "document.readyState === 'complete'", 30)?;
        Ok(page)
    }

    /// Closes a page.
    ///
    /// # Errors
    /// When the browser does not.
    pub fn close(&mut self, page: &Page) -> Result<()> {
        self.on(page, "Page.close", &json!({})).map(|_| ())
    }

    fn on(&mut self, page: &Page, method: &str, params: &Value) -> Result<Value> {
        self.call(Some(&page.session), method, params)
    }

    /// The value of an expression, which may be a promise.
    ///
    /// # Errors
    /// The expression throws.
    pub fn eval(&mut self, page: &Page, expression: &str) -> Result<Value> {
        let params = json!({"expression": expression, "awaitPromise": true, "returnByValue": true});
        let found = self.on(page, "Runtime.evaluate", &params)?;
        if let Some(thrown) = found.get("exceptionDetails") {
            bail!("{expression}: {}", thrown["exception"]["description"]);
        }
        Ok(found["result"]["value"].clone())
    }

    /// Processor time of the page so far, s of its own thread: script, style, layout, paint.
    ///
    /// # Errors
    /// The browser does not answer.
    pub fn worked(&mut self, page: &Page) -> Result<f64> {
        let told = self.on(page, "Performance.getMetrics", &json!({}))?;
        let metrics = told["metrics"].as_array().context("metrics")?;
        let found = metrics.iter().find(|m| m["name"] == "TaskDuration");
        found
            .and_then(|m| m["value"].as_f64())
            .context("the page's time")
    }

    /// Waits until an expression is true.
    ///
    /// # Errors
    /// If it is not true within this many seconds.
    pub fn wait(&mut self, page: &Page, expression: &str, seconds: u64) -> Result<()> {
        let started = Instant::now();
        while started.elapsed() < Duration::from_secs(seconds) {
            if self.eval(page, expression).is_ok_and(|v| v == true) {
                return Ok(());
            }
            std::thread::sleep(Duration::from_millis(50));
        }
        bail!(
            "after {seconds} s it is not so: {expression}; errors: {:?}",
            self.faults
        )
    }

    /// Moves the mouse, and clicks if `press` is set.
    ///
    /// # Errors
    /// When the browser does not.
    pub fn mouse(&mut self, page: &Page, x: f64, y: f64, press: bool) -> Result<()> {
        let mut kinds = vec!["mouseMoved"];
        if press {
            kinds.extend(["mousePressed", "mouseReleased"]);
        }
        for kind in kinds {
            let event = json!({"type": kind, "x": x, "y": y, "button": if kind == "mouseMoved" { "none" } else { "left" }, "clickCount": 1});
            self.on(page, "Input.dispatchMouseEvent", &event)?;
        }
        Ok(())
    }

    /// Presses a key, as in `ArrowRight`, `Tab`.
    ///
    /// # Errors
    /// When the browser does not.
    pub fn key(&mut self, page: &Page, key: &str) -> Result<()> {
        for kind in ["keyDown", "keyUp"] {
            self.on(
                page,
                "Input.dispatchKeyEvent",
                &json!({"type": kind, "key": key, "code": key}),
            )?;
        }
        Ok(())
    }

    /// A screenshot of the visible part, PNG.
    ///
    /// # Errors
    /// If it cannot be taken or written.
    pub fn screenshot(&mut self, page: &Page, path: &Path) -> Result<()> {
        use base64::Engine as _;
        let taken = self.on(page, "Page.captureScreenshot", &json!({"format": "png"}))?;
        let text = taken["data"].as_str().context("a picture")?;
        let bytes = base64::engine::general_purpose::STANDARD.decode(text)?;
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder)?;
        }
        Ok(fs::write(path, bytes)?)
    }

    /// The page printed to PDF.
    ///
    /// # Errors
    /// When it cannot be printed.
    pub fn pdf(&mut self, page: &Page) -> Result<Vec<u8>> {
        use base64::Engine as _;
        let params = json!({"printBackground": true, "preferCSSPageSize": true});
        let printed = self.on(page, "Page.printToPDF", &params)?;
        let text = printed["data"].as_str().context("a document")?;
        Ok(base64::engine::general_purpose::STANDARD.decode(text)?)
    }
}
