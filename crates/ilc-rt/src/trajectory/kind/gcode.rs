//! A G-code part program.

use super::{Corner, FileKind, Job, Key, Kind, ProgramError};
use crate::interpolate::{AxisUnit, Interpolator};
use crate::trajectory::program::{GcodeSetting, read_gcode};

pub(super) const KIND: Kind = Kind {
    reads: &[Key::File, Key::Rapid, Key::BlockDelete],
    needs: &[Key::File],
    summary: "a part program, see [below](#part-programs). `rapid_m_s` is the speed of G0, by \
              default `feed_m_s`",
    file: Some(FileKind { content: "G-code", bytes_max: 16 << 20 }),
    is_plane: false,
    plan,
    describe: |program| format!("part program {}", program.file_name().display()),
    example: "kind = \"gcode\"\nstart_m = [0.0, 0.0]\nfeed_m_s = 0.02\nfile = \"example.txt\"",
    example_file: "G1 X20 F1200\nG3 X0 Y20 I-20\nM2\n",
};

fn plan(job: &Job) -> Result<Interpolator, ProgramError> {
    let program = job.program;
    let rotary: Vec<bool> = job.units.iter().map(|unit| *unit == AxisUnit::Rad).collect();
    let setting = GcodeSetting {
        start_m: &program.start_m,
        feed_m_s: program.feed_m_s,
        rapid_m_s: program.rapid_m_s.unwrap_or(program.feed_m_s),
        rotary: &rotary,
        exact_corners: program.corner == Corner::ExactStop,
        block_delete: program.block_delete,
    };
    let read = read_gcode(job.text, &setting)?;
    job.along_segments(read.segments, &read.rapid, read.dwell_before_s)
}
