//! The output queue: bounded, and a frame enters completely or not at all.

use heapless::Deque;

/// Bytes of a queue on a board: two frames of the law's samples and an answer.
pub const ROOM: usize = 640;

/// Queue of the bytes to be sent. None of its functions blocks.
#[derive(Clone, Debug, Default)]
pub struct Outbox {
    bytes: Deque<u8, ROOM>,
}

impl Outbox {
    /// Nothing to send.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            bytes: Deque::new(),
        }
    }

    /// Adds all of `bytes`, or none if they do not fit.
    pub fn offer(&mut self, bytes: &[u8]) -> bool {
        if bytes.len() > ROOM - self.bytes.len() {
            return false;
        }
        for byte in bytes {
            let _ = self.bytes.push_back(*byte);
        }
        true
    }

    /// The next byte to send.
    #[inline]
    pub fn pop(&mut self) -> Option<u8> {
        self.bytes.pop_front()
    }

    /// Bytes that wait.
    #[must_use]
    pub fn len(&self) -> usize {
        self.bytes.len()
    }

    /// Whether nothing waits.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    proptest! {
        #[test]
        fn what_goes_in_comes_out_whole_and_in_order(
            offers in prop::collection::vec(
                (prop::collection::vec(any::<u8>(), 0..300), 0_usize..400), 1..40),
        ) {
            let mut outbox = Outbox::new();
            let (mut taken, mut sent) = (Vec::new(), Vec::new());
            for (bytes, room) in offers {
                let fits = bytes.len() <= ROOM - outbox.len();
                prop_assert_eq!(outbox.offer(&bytes), fits);
                if fits {
                    taken.extend(bytes);
                }
                sent.extend((0..room).map_while(|_| outbox.pop()));
            }
            while let Some(byte) = outbox.pop() {
                sent.push(byte);
            }
            prop_assert_eq!(sent, taken);
            prop_assert!(outbox.is_empty());
        }
    }
}
