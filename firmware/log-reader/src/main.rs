//! Prints the messages in a file of `defmt` frames: `log-reader ELF FRAMES`.

use anyhow::{Context, Result, bail};
use defmt_decoder::{DecodeError, Table};

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [elf, frames] = arguments.as_slice() else {
        bail!("usage: log-reader ELF FRAMES");
    };
    let read = |path: &str| std::fs::read(path).with_context(|| format!("could not read {path}"));
    let elf = read(elf)?;
    let table = Table::parse(&elf)?.context("the program has no log messages")?;
    let mut decoder = table.new_stream_decoder();
    decoder.received(&read(frames)?);
    loop {
        match decoder.decode() {
            Ok(frame) => println!("{}", frame.display(false)),
            // A restart of the board within a frame leaves a damaged frame.
            Err(DecodeError::Malformed) if table.encoding().can_recover() => {}
            Err(DecodeError::Malformed) => bail!("the frames are damaged"),
            Err(DecodeError::UnexpectedEof) => return Ok(()),
        }
    }
}
