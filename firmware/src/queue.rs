//! Bytes between an interrupt and the loop: one writes, the other reads, and
//! neither waits.

use core::sync::atomic::{AtomicU8, AtomicUsize, Ordering};

/// A ring of up to `LEN` − 1 bytes for one writer and one reader.
#[derive(Debug)]
pub struct Queue<const LEN: usize> {
    bytes: [AtomicU8; LEN],
    /// Where the next byte is read; moved by the reader only.
    head: AtomicUsize,
    /// Where the next byte is written; moved by the writer only.
    tail: AtomicUsize,
}

impl<const LEN: usize> Queue<LEN> {
    /// Empty.
    #[must_use]
    pub const fn new() -> Self {
        const { assert!(LEN > 1, "a queue holds at least one byte") };
        Self {
            bytes: [const { AtomicU8::new(0) }; LEN],
            head: AtomicUsize::new(0),
            tail: AtomicUsize::new(0),
        }
    }

    /// Adds a byte; `false`, and the byte is lost, if the queue is full.
    #[inline]
    pub fn put(&self, byte: u8) -> bool {
        let tail = self.tail.load(Ordering::Relaxed);
        let next = Self::after(tail);
        if next == self.head.load(Ordering::Acquire) {
            return false;
        }
        if let Some(slot) = self.bytes.get(tail) {
            slot.store(byte, Ordering::Relaxed);
        }
        self.tail.store(next, Ordering::Release);
        true
    }

    /// Takes the oldest byte.
    #[inline]
    pub fn take(&self) -> Option<u8> {
        let head = self.head.load(Ordering::Relaxed);
        if head == self.tail.load(Ordering::Acquire) {
            return None;
        }
        let byte = self.bytes.get(head)?.load(Ordering::Relaxed);
        self.head.store(Self::after(head), Ordering::Release);
        Some(byte)
    }

    #[inline]
    const fn after(index: usize) -> usize {
        if index + 1 < LEN { index + 1 } else { 0 }
    }
}

impl<const LEN: usize> Default for Queue<LEN> {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_come_out_in_order_and_a_full_queue_refuses() {
        let queue = Queue::<4>::new();
        assert_eq!(queue.take(), None);
        for round in 0..10 {
            for byte in 0..3 {
                assert!(queue.put(round * 10 + byte));
            }
            assert!(!queue.put(99));
            for byte in 0..3 {
                assert_eq!(queue.take(), Some(round * 10 + byte));
            }
            assert_eq!(queue.take(), None);
        }
    }

    /// One thread writes while another reads: nothing is lost, doubled or turned.
    #[test]
    fn writer_and_reader_do_not_disturb_each_other() {
        static QUEUE: Queue<16> = Queue::new();
        let writer = std::thread::spawn(|| {
            for k in 0..100_000_u32 {
                while !QUEUE.put(k as u8) {
                    std::hint::spin_loop();
                }
            }
        });
        for k in 0..100_000_u32 {
            let byte = loop {
                if let Some(byte) = QUEUE.take() {
                    break byte;
                }
                std::hint::spin_loop();
            };
            assert_eq!(byte, k as u8);
        }
        writer.join().unwrap();
    }
}
