//! TensorBoard event files: `RUN/tensorboard/events.out.tfevents.…`, one per session.
//!
//! The format is a sequence of records, each a length and a protocol-buffer message with masked CRC-32C checksums around
//! them (tensorflow/core/lib/io/record_writer.h; tensorflow/core/util/event.proto, framework/summary.proto). Only the few
//! fields that scalars and pictures need are written, by hand: the crates that know the whole format bring TensorFlow's
//! protocol definitions with them.

use crate::run::event::{Observer, TrainEvent};
use crate::run::folder::RunDir;
use image::ImageDecoder;
use miette::{IntoDiagnostic, Report, WrapErr};
use std::fs::File;
use std::io::{self, BufWriter, Cursor, Write};
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

/// A TensorBoard event file being written.
pub struct EventFile<W: Write> {
    file: W,
}

impl<W: Write> EventFile<W> {
    /// Begins a file. TensorBoard forgets what older files of the folder say about `first_step` and later ones.
    ///
    /// # Errors
    /// The writer's.
    pub fn begin(file: W, first_step: u64) -> io::Result<Self> {
        let mut events = Self { file };
        events.event(0, ProtocolMessage::default().bytes(3, b"brain.Event:2"))?;
        let session = ProtocolMessage::default().integer(1, 1); // SessionLog.status = START
        events.event(first_step, ProtocolMessage::default().bytes(7, &session.0))?;
        Ok(events)
    }

    /// One value per tag, all of one step.
    ///
    /// # Errors
    /// The writer's.
    pub fn scalars<T: AsRef<str>>(
        &mut self,
        step: u64,
        values: impl Iterator<Item = (T, f64)>,
    ) -> io::Result<()> {
        let summary = values.fold(ProtocolMessage::default(), |summary, (tag, value)| {
            summary.bytes(
                1,
                &ProtocolMessage::default().bytes(1, tag.as_ref().as_bytes()).float(2, value as f32).0,
            )
        });
        self.summary(step, summary)
    }

    /// A PNG picture of `size` (width, height).
    ///
    /// # Errors
    /// The writer's.
    pub fn picture(&mut self, step: u64, tag: &str, png: &[u8], size: (u32, u32)) -> io::Result<()> {
        let [width, height] = [size.0, size.1].map(u64::from);
        let colours = 3; // RGB
        let image =
            ProtocolMessage::default().integer(1, height).integer(2, width).integer(3, colours).bytes(4, png);
        let entry = ProtocolMessage::default().bytes(1, tag.as_bytes()).bytes(4, &image.0);
        self.summary(step, ProtocolMessage::default().bytes(1, &entry.0))
    }

    /// Has the system write what was given so far.
    ///
    /// # Errors
    /// The writer's.
    pub fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }

    fn summary(&mut self, step: u64, summary: ProtocolMessage) -> io::Result<()> {
        self.event(step, ProtocolMessage::default().bytes(5, &summary.0))
    }

    /// Writes an event whose content is `what`.
    fn event(&mut self, step: u64, what: ProtocolMessage) -> io::Result<()> {
        let now = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |d| d.as_secs_f64());
        let mut event = ProtocolMessage::default().double(1, now).integer(2, step);
        event.0.extend(what.0);
        let length = (event.0.len() as u64).to_le_bytes();
        self.file.write_all(&length)?;
        self.file.write_all(&masked_checksum(&length))?;
        self.file.write_all(&event.0)?;
        self.file.write_all(&masked_checksum(&event.0))
    }
}

/// CRC-32C, rotated and shifted so that a checksum of data with checksums in it stays a good one.
fn masked_checksum(data: &[u8]) -> [u8; 4] {
    crc32c::crc32c(data).rotate_right(15).wrapping_add(0xa282_ead8).to_le_bytes()
}

/// A protocol-buffer message in the making.
#[derive(Default)]
struct ProtocolMessage(Vec<u8>);

impl ProtocolMessage {
    fn variable(&mut self, mut value: u64) {
        while value >= 0x80 {
            self.0.push(value as u8 | 0x80);
            value >>= 7;
        }
        self.0.push(value as u8);
    }

    fn key(&mut self, field: u64, wire: u64) {
        self.variable((field << 3) | wire);
    }

    fn integer(mut self, field: u64, value: u64) -> Self {
        self.key(field, 0);
        self.variable(value);
        self
    }

    fn double(mut self, field: u64, value: f64) -> Self {
        self.key(field, 1);
        self.0.extend(value.to_le_bytes());
        self
    }

    fn bytes(mut self, field: u64, value: &[u8]) -> Self {
        self.key(field, 2);
        self.variable(value.len() as u64);
        self.0.extend(value);
        self
    }

    fn float(mut self, field: u64, value: f32) -> Self {
        self.key(field, 5);
        self.0.extend(value.to_le_bytes());
        self
    }
}

/// Writes the event file of a session.
pub struct TensorBoardObserver {
    path: PathBuf,
    events: EventFile<BufWriter<File>>,
    every: u64,
    step: u64,
}

impl TensorBoardObserver {
    /// Begins a file for a session that goes on after `step`; every `every`-th step is written.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn new(run: &RunDir, step: u64, every: u64) -> Result<Self, Report> {
        let folder = run.tensorboard();
        let seconds = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_secs());
        // TensorBoard reads the files of a folder in the order of their names.
        let mut path = folder.join(format!("events.out.tfevents.{seconds:010}.{:010}.clothcombo", step));
        if path.exists() {
            path.set_extension(format!("clothcombo-{}", std::process::id()));
        }
        let begin = || {
            std::fs::create_dir_all(&folder)?;
            EventFile::begin(BufWriter::new(File::create(&path)?), step + 1)
        };
        let events =
            begin().into_diagnostic().wrap_err_with(|| format!("cannot write {}", path.display()))?;
        Ok(Self { path, events, every, step })
    }

    fn write(&mut self, event: &TrainEvent) -> io::Result<()> {
        match event {
            TrainEvent::Step(r) => {
                self.step = r.step;
                if r.step % self.every != 0 {
                    return Ok(());
                }
                let plain = [
                    ("loss/weighted", r.loss),
                    ("gradient/norm", r.grad_norm),
                    ("schedule/learning_rate", r.lr),
                    ("schedule/pose_scale", r.pose_scale),
                    ("schedule/layers", r.layers as f64),
                    ("time/step", r.seconds),
                    ("time/wait", r.wait_seconds),
                    ("time/forward", r.forward_seconds),
                    ("time/backward", r.backward_seconds),
                    ("time/update", r.update_seconds),
                ];
                let plain = plain.into_iter().map(|(name, value)| (name.to_owned(), value));
                let raw = r.raw.iter().map(|(name, value)| (format!("raw/{name}"), *value));
                self.events.scalars(r.step, plain.chain(raw))
            }
            TrainEvent::Validated { step, report, .. } => {
                let mut values = Vec::new();
                for group in &report.groups {
                    let Some(network) = group.methods.last() else { continue };
                    let tag = |what: &str| format!("validation, {}/{what}", group.group);
                    values.push((tag("total"), network.total.mean));
                    values.push((tag("inside the body"), network.inside));
                    values.push((tag("layer-order violations"), network.order_violations_nearest_vertex));
                    values.extend(network.raw.iter().map(|(name, spread)| (tag(name), spread.mean)));
                }
                self.events.scalars(*step, values.into_iter())?;
                self.events.flush()
            }
            TrainEvent::SampleDrawn { path } => self.picture(path),
            TrainEvent::CheckpointDue
            | TrainEvent::Interrupted { .. }
            | TrainEvent::GaveUp { .. }
            | TrainEvent::Finished { .. } => self.events.flush(),
            _ => Ok(()),
        }
    }

    fn picture(&mut self, path: &Path) -> io::Result<()> {
        let png = std::fs::read(path)?;
        let decoder = image::codecs::png::PngDecoder::new(Cursor::new(&png)).map_err(io::Error::other)?;
        let size = decoder.dimensions();
        self.events.picture(self.step, "samples", &png, size)
    }
}

impl Observer for TensorBoardObserver {
    fn observe(&mut self, event: &TrainEvent) -> Result<(), Report> {
        let written = self.write(event);
        written.into_diagnostic().wrap_err_with(|| format!("cannot write {}", self.path.display()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Splits a file into its records, checking both checksums of each.
    fn records(mut file: &[u8]) -> Vec<Vec<u8>> {
        let mut out = Vec::new();
        while !file.is_empty() {
            let (length, rest) = file.split_at(8);
            assert_eq!(rest[..4], masked_checksum(length));
            let length = u64::from_le_bytes(length.try_into().unwrap()) as usize;
            let data = &rest[4..4 + length];
            assert_eq!(rest[4 + length..8 + length], masked_checksum(data));
            out.push(data.to_vec());
            file = &rest[8 + length..];
        }
        out
    }

    #[test]
    fn checksums_are_the_published_ones() {
        // The CRC-32C of the nine digits is the check value of the polynomial, 0xe3069283.
        let crc = 0xe306_9283_u32;
        let masked = crc.rotate_right(15).wrapping_add(0xa282_ead8);
        assert_eq!(masked_checksum(b"123456789"), masked.to_le_bytes());
    }

    #[test]
    fn records_hold_version_start_and_values() {
        let mut bytes = Vec::new();
        let mut file = EventFile::begin(&mut bytes, 300).unwrap();
        file.scalars(300, [("loss/weighted", 1.5)].into_iter()).unwrap();
        let records = records(&bytes);
        assert_eq!(records.len(), 3);
        let holds = |record: &[u8], part: &[u8]| record.windows(part.len()).any(|w| w == part);
        assert!(holds(&records[0], b"\x1a\x0dbrain.Event:2"));
        assert!(holds(&records[1], &[0x10, 0xac, 0x02, 0x3a, 0x02, 0x08, 0x01]), "step 300, START");
        assert!(holds(&records[2], b"\x0a\x0dloss/weighted\x15\x00\x00\xc0\x3f"));
    }
}
