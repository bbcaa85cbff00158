//! Two sequences side by side.

/// The items of two sequences in pairs, up to the end of the shorter one.
///
/// [`Iterator::zip`] calls a function of the core library, which is not inlined without link-time optimisation. In
/// short loops within every sample that call costs more than the loops.
#[inline(always)]
pub fn pairs<A: IntoIterator, B: IntoIterator>(a: A, b: B) -> Pairs<A::IntoIter, B::IntoIter> {
    Pairs(a.into_iter(), b.into_iter())
}

/// The iterator of [`pairs`].
#[derive(Clone, Debug)]
pub struct Pairs<A, B>(A, B);

impl<A: Iterator, B: Iterator> Iterator for Pairs<A, B> {
    type Item = (A::Item, B::Item);
    #[inline(always)]
    fn next(&mut self) -> Option<Self::Item> {
        Some((self.0.next()?, self.1.next()?))
    }
}
