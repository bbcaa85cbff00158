//! One task at a time, reported to every open page.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use serde_json::{Value, json};
use tokio::sync::broadcast;

/// A running task: it reports its progress and is informed when it should end.
#[derive(Debug, Clone)]
pub struct Work {
    shared: Arc<Shared>,
}

#[derive(Debug)]
struct Shared {
    cancel: AtomicBool,
    events: broadcast::Sender<String>,
    running: Mutex<Option<Running>>,
}

#[derive(Debug, Clone)]
struct Running {
    name: String,
    now: String,
    /// Start of the present stage.
    stage_started: Instant,
    /// Best value of the running search so far, over its evaluations.
    best: Vec<(usize, f64)>,
    /// Largest number of evaluations of that search; 0 for none.
    budget: usize,
    started: Instant,
}

impl Running {
    /// Starts another stage, without results of the previous one.
    fn stage(&mut self) {
        self.stage_started = Instant::now();
        self.best.clear();
        self.budget = 0;
    }

    /// Stores the best value of a search; fewer evaluations or a higher value than before belong to another search.
    fn note(&mut self, evaluations: usize, best: f64) {
        const KEPT: usize = 1000;
        // A search never loses its best value.
        let is_another = |last: &(usize, f64)| evaluations < last.0 || best > last.1;
        if self.best.last().is_some_and(is_another) {
            self.stage();
        }
        // Of an interval with a constant value only the two ends are stored.
        if let [.., before, last] = self.best.as_slice()
            && before.1 == best
            && last.1 == best
        {
            self.best.pop();
        }
        self.best.push((evaluations, best));
        if self.best.len() > KEPT {
            let mut odd = false;
            self.best.retain(|_| {
                odd = !odd;
                odd
            });
        }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // Stored values are replaced as a whole, so a panic elsewhere leaves none half-changed.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Work {
    pub(crate) fn new() -> Self {
        let (events, _) = broadcast::channel(256);
        Self {
            shared: Arc::new(Shared {
                cancel: AtomicBool::new(false),
                events,
                running: Mutex::new(None),
            }),
        }
    }

    /// Set when the user requests the best result so far.
    #[must_use]
    pub fn cancel(&self) -> &AtomicBool {
        &self.shared.cancel
    }

    /// A stage of the task begins.
    pub fn begins(&self, words: &str) {
        self.says(words, true);
    }

    /// The present activity of the task, in words. Words that differ in more than their numbers are another stage.
    pub fn now(&self, words: &str) {
        self.says(words, false);
    }

    fn says(&self, words: &str, begins: bool) {
        let mut stage = begins;
        if let Some(running) = lock(&self.shared.running).as_mut() {
            let letters = |text: &str| text.replace(|c: char| c.is_ascii_digit(), "");
            stage |= letters(&running.now) != letters(words);
            if stage {
                running.stage();
            }
            words.clone_into(&mut running.now);
        }
        self.tell(&json!({"kind": "now", "words": words, "stage": stage}));
    }

    /// The best value of a search after this many evaluations of a `budget`.
    pub fn best(&self, evaluations: usize, budget: usize, best: f64) {
        if !best.is_finite() {
            return;
        }
        if let Some(running) = lock(&self.shared.running).as_mut() {
            running.note(evaluations, best);
            running.budget = budget;
        }
        self.tell(
            &json!({"kind": "best", "evaluations": evaluations, "budget": budget, "best": best}),
        );
    }

    /// A warning for the user.
    pub fn warning(&self, words: &str) {
        self.tell(&json!({"kind": "warning", "words": words}));
    }

    pub(crate) fn tell(&self, event: &Value) {
        // A task without an open page is not an error.
        let _ = self.shared.events.send(event.to_string());
    }

    pub(crate) fn listen(&self) -> broadcast::Receiver<String> {
        self.shared.events.subscribe()
    }

    /// The running task, for a page that was just opened.
    pub(crate) fn state(&self) -> Value {
        match lock(&self.shared.running).as_ref() {
            None => Value::Null,
            Some(r) => json!({
                "name": r.name, "now": r.now, "best": r.best, "budget": r.budget,
                "elapsed_s": r.started.elapsed().as_secs_f64(),
                "stage_s": r.stage_started.elapsed().as_secs_f64(),
            }),
        }
    }

    /// Reserves the bench for a task; `None` while another one runs.
    pub(crate) fn begin(&self, name: &str) -> bool {
        let mut running = lock(&self.shared.running);
        if running.is_some() {
            return false;
        }
        *running = Some(Running {
            name: name.to_owned(),
            now: String::new(),
            best: Vec::new(),
            budget: 0,
            started: Instant::now(),
            stage_started: Instant::now(),
        });
        drop(running);
        self.shared.cancel.store(false, Ordering::Relaxed);
        self.tell(&json!({"kind": "begins", "name": name}));
        true
    }

    pub(crate) fn end(&self, error: Option<&str>) {
        *lock(&self.shared.running) = None;
        self.tell(&json!({"kind": "ends", "error": error}));
    }

    pub(crate) fn ask_to_end(&self) {
        self.shared.cancel.store(true, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_second_search_has_a_curve_of_its_own() {
        let work = Work::new();
        assert!(work.begin("identifying"));
        for (evaluations, best) in [(1, 3.0), (2, 2.0), (5, 2.0), (9, 2.0)] {
            work.best(evaluations, 0, best);
        }
        assert_eq!(work.state()["best"], json!([[1, 3.0], [2, 2.0], [9, 2.0]]));
        for (evaluations, best) in [(1, 4.0), (3, 1.0), (4, f64::INFINITY)] {
            work.best(evaluations, 0, best);
        }
        assert_eq!(work.state()["best"], json!([[1, 4.0], [3, 1.0]]));
        // Other words are another stage; the same words with another number are not.
        for (words, left) in [("fold 1 of 3", 0), ("fold 2 of 3", 1)] {
            work.now(words);
            assert_eq!(work.state()["best"].as_array().unwrap().len(), left);
            work.best(5, 0, 0.5);
        }
        work.best(6, 0, 0.7);
        assert_eq!(work.state()["best"], json!([[6, 0.7]]));
        work.begins("fold 2 of 3");
        assert_eq!(work.state()["best"], json!([]));
        work.end(None);
        assert!(work.state().is_null());
    }

    #[test]
    fn a_long_search_keeps_its_course_and_little_more() {
        let work = Work::new();
        work.begin("identifying");
        for n in 0..50_000 {
            work.best(n, 0, 1.0 / (n as f64 + 1.0));
        }
        let state = work.state();
        let kept = state["best"].as_array().unwrap();
        assert!(kept.len() <= 1000 && kept.last().unwrap()[0] == 49_999);
    }
}
