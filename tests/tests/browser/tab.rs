//! A browser and its pages, as the tests use them.

use std::cell::RefCell;

use scenarios::browser::{Browser, Page};
use serde_json::Value;

use super::{picture, root};

/// A running browser.
pub(crate) struct Window(RefCell<Browser>);

impl Window {
    pub(crate) fn start() -> Self {
        Self(RefCell::new(Browser::start().expect("chromium")))
    }

    pub(crate) fn open(&self, address: &str, size: (u32, u32)) -> Tab<'_> {
        self.tab(address, size, false)
    }

    /// A page for a user who prefers dark pages.
    pub(crate) fn open_dark(&self, address: &str, size: (u32, u32)) -> Tab<'_> {
        self.tab(address, size, true)
    }

    fn tab(&self, address: &str, size: (u32, u32), dark: bool) -> Tab<'_> {
        let page = self.0.borrow_mut().open(address, size, dark);
        Tab {
            browser: &self.0,
            page: page.expect("a page"),
        }
    }

    /// Errors that the pages reported since the last call.
    pub(crate) fn faults(&self) -> Vec<String> {
        self.0.borrow_mut().faults()
    }

    #[track_caller]
    pub(crate) fn has_no_faults(&self) {
        assert_eq!(self.faults(), Vec::<String>::new());
    }
}

/// An open page.
pub(crate) struct Tab<'a> {
    browser: &'a RefCell<Browser>,
    page: Page,
}

impl Tab<'_> {
    /// Evaluates an expression.
    #[track_caller]
    pub(crate) fn act(&self, expression: &str) -> Value {
        let value = self.browser.borrow_mut().eval(&self.page, expression);
        value.expect("an expression of the test")
    }

    /// Waits until an expression is true; the time limit is generous for an idle machine.
    #[track_caller]
    pub(crate) fn until(&self, seconds: u64, expression: &str) {
        const BUSY: u64 = 3;
        let mut browser = self.browser.borrow_mut();
        if let Err(error) = browser.wait(&self.page, expression, BUSY * seconds) {
            let said = "document.getElementById('message')?.textContent ?? ''";
            let said = browser.eval(&self.page, said);
            let _ = browser.screenshot(&self.page, &picture("failed.png"));
            panic!("{error}; the page says {said:?}");
        }
    }

    /// Waits until `count` elements match `selector`.
    #[track_caller]
    pub(crate) fn has(&self, seconds: u64, selector: &str, count: usize) {
        let found = format!("document.querySelectorAll('{selector}').length === {count}");
        self.until(seconds, &found);
    }

    /// Waits until the text of an element contains `text`.
    #[track_caller]
    pub(crate) fn says(&self, seconds: u64, selector: &str, text: &str) {
        let said = format!("document.querySelector('{selector}').textContent.includes('{text}')");
        self.until(seconds, &said);
    }

    /// Waits until no task runs and there are this many models.
    #[track_caller]
    pub(crate) fn idles_with(&self, seconds: u64, models: usize) {
        let models = format!("document.querySelectorAll('.model').length === {models}");
        let idle = format!("document.getElementById('work').hidden && {models}");
        self.until(seconds, &idle);
    }

    #[track_caller]
    pub(crate) fn click(&self, selector: &str) {
        self.act(&format!("document.querySelector('{selector}').click()"));
    }

    /// Clicks on the element with exactly this text.
    #[track_caller]
    pub(crate) fn click_text(&self, selector: &str, text: &str) {
        self.act(&format!(
            "[...document.querySelectorAll('{selector}')].find(x => x.textContent === '{text}').click()"
        ));
    }

    #[track_caller]
    pub(crate) fn scroll_to(&self, selector: &str) {
        self.act(&format!(
            "document.querySelector('{selector}').scrollIntoView()"
        ));
    }

    #[track_caller]
    pub(crate) fn text(&self, selector: &str) -> String {
        let text = self.act(&format!("document.querySelector('{selector}').textContent"));
        text.as_str().expect("text").to_owned()
    }

    /// The file behind the link with this text.
    #[track_caller]
    pub(crate) fn download(&self, links: &str, text: &str) -> String {
        let file = self.act(&format!(
            "fetch([...document.querySelectorAll('{links}')].find(a => a.textContent.includes('{text}')).href).then(r => r.text())"
        ));
        file.as_str().expect("text").to_owned()
    }

    /// Validation error of the newest model over the noise level.
    #[track_caller]
    pub(crate) fn times_noise(&self) -> f64 {
        let times_noise = self.act(
            "fetch('/api/state', {headers: {'x-token': new URLSearchParams(location.search).get('token')}}).then(r => r.json()).then(s => { const m = s.models.at(-1); return m.rmse / m.noise_rmse; })",
        );
        eprintln!("  the validation error is {times_noise} times the noise");
        times_noise.as_f64().expect("a number")
    }

    pub(crate) fn mouse(&self, x: f64, y: f64) {
        let moved = self.browser.borrow_mut().mouse(&self.page, x, y, false);
        moved.expect("a mouse");
    }

    pub(crate) fn key(&self, key: &str) {
        let pressed = self.browser.borrow_mut().key(&self.page, key);
        pressed.expect("a key");
    }

    /// The page as printed.
    pub(crate) fn pdf(&self) -> Vec<u8> {
        self.browser.borrow_mut().pdf(&self.page).expect("a PDF")
    }

    /// Takes a picture, an artefact of CI.
    pub(crate) fn screenshot(&self, path: &std::path::Path) {
        let taken = self.browser.borrow_mut().screenshot(&self.page, path);
        taken.expect("a picture");
    }

    /// An empty page of the same browser.
    pub(crate) fn empty(&self, size: (u32, u32)) -> Self {
        let page = self.browser.borrow_mut().open("about:blank", size, false);
        Self {
            browser: self.browser,
            page: page.expect("a page"),
        }
    }

    pub(crate) fn close(self) {
        let closed = self.browser.borrow_mut().close(&self.page);
        closed.expect("closed");
    }

    /// WCAG 2.1 A and AA, as far as a program can check them.
    #[track_caller]
    pub(crate) fn accessible(&self) {
        let path = root().join("host-fit/web/node_modules/axe-core/axe.min.js");
        let axe = std::fs::read_to_string(path).expect("axe-core: run `cargo xtask pages`");
        self.act(&format!("{axe};1"));
        let found = self.act(
            "axe.run(document, {runOnly: ['wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa']}).then(r => r.violations.map(v => v.id + ': ' + v.nodes.length + ' ' + v.nodes[0].html.slice(0, 160) + ' ' + v.nodes[0].failureSummary))",
        );
        assert_eq!(found, Value::Array(Vec::new()), "{found:#}");
    }

    /// No page is wider than a phone.
    #[track_caller]
    pub(crate) fn fits(&self, width: f64) {
        let wide = self.act("document.documentElement.scrollWidth");
        assert!(wide.as_f64() <= Some(width), "{wide} px wide on {width} px");
    }

    /// Text in pictures is at least 11 px high on the screen, and is not cut off at the picture's edge.
    #[track_caller]
    pub(crate) fn readable(&self) {
        let wrong = self.act(
            "[...document.querySelectorAll('figure svg')].filter(s => s.clientWidth > 0).flatMap(s => { const box = s.getBoundingClientRect(), scale = box.width / s.viewBox.baseVal.width; return [...s.querySelectorAll('text')].flatMap(t => { const r = t.getBoundingClientRect(), px = scale * Number(t.getAttribute('font-size')); return px < 11 ? [`${px.toFixed(1)} px: ${t.textContent}`] : r.left < box.left - 1 || r.right > box.right + 1 || t.textContent.endsWith('…') ? [`cut: ${t.textContent}`] : []; }); })",
        );
        assert_eq!(wrong, Value::Array(Vec::new()), "{wrong:#}");
    }

    /// Pans the records of a page, with everything in sight redrawn in each frame. Returns the milliseconds of the
    /// page's own thread per frame, and prints the duration of a frame by this machine's clock under its present
    /// load.
    pub(crate) fn panned(&self) -> f64 {
        const FRAMES: u32 = 120;
        let worked = || {
            self.browser
                .borrow_mut()
                .worked(&self.page)
                .expect("its time")
        };
        let before = worked();
        let frame = self.act(&format!(
            "(async () => {{ const v = hostFit.groups[0].view; const times = []; let last = performance.now(); for (let i = 0; i < {FRAMES}; i++) {{ v.show(i * 0.03, 5 + i * 0.03); await new Promise(r => requestAnimationFrame(r)); const now = performance.now(); times.push(now - last); last = now; }} return times.sort((a, b) => a - b)[{FRAMES} / 2]; }})()"
        ));
        let own = 1000.0 * (worked() - before) / f64::from(FRAMES);
        let clock = frame.as_f64().expect("ms");
        eprintln!(
            "  panned: {own:.1} ms of the page's thread in a frame; {clock:.1} ms by the clock"
        );
        own
    }
}
