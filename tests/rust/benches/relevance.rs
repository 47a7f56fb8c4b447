//! Speed of learning from many past runs, as ratios measured in one run: the 30 most relevant ones
//! relative to all of them, and many relative to few.

#![expect(clippy::print_stdout, reason = "a benchmark tells what it measured")]

use std::error::Error;
use std::time::{Duration, Instant};

use ilc_rt::learning::Law;
use ilc_rt::learning::law::pd::{Pd, PdGains};
use ilc_rt::learning::law::q_filter::QFilter;
use ilc_rt::learning::law::relevance::{Relevance, RelevanceWeights, RunShape};

/// Samples of the modulated tool path in \[dimarco2016\], Appendix A.
const N_SAMPLES: usize = 1401;
const TOP: usize = 30;
const N_RUNS: [usize; 3] = [500, 5_000, 50_000];

fn main() -> Result<(), Box<dyn Error>> {
    let few = measure(N_RUNS[0])?;
    for n_runs in &N_RUNS[1..] {
        let many = measure(*n_runs)?;
        println!(
            "{:>6} runs kept: {:.2} times as long as with {}",
            n_runs,
            many.as_secs_f64() / few.as_secs_f64(),
            N_RUNS[0]
        );
    }
    Ok(())
}

/// Pseudo-random numbers from -1 to 1, the same in every run of the benchmark.
struct Random(u64);

impl Random {
    fn signed(&mut self) -> f64 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}

/// Fills a memory and returns the time of an update from its most relevant runs.
fn measure(n_runs: usize) -> Result<Duration, Box<dyn Error>> {
    let shape =
        RunShape { n_samples: N_SAMPLES, n_inputs: 1, n_outputs: 1, n_disturbances: 1, dt_s: 0.01 };
    let core = || -> Result<Box<dyn Law>, Box<dyn Error>> {
        let gains = PdGains { kp: 1.284, kd: 1.284, lead_samples: 1 };
        Ok(Box::new(Pd::new(gains, N_SAMPLES, 1, QFilter::None)?))
    };
    let mut random = Random(1);
    let input: Vec<f64> = (0..N_SAMPLES).map(|_| random.signed()).collect();
    // One law at a time: 50,000 runs are 560 MB.
    let mut fastest = Duration::MAX;
    let mut times = [Duration::ZERO; 2];
    for (time, top) in times.iter_mut().zip([Some(TOP), None]) {
        let mut law = Relevance::new(core()?, shape, RelevanceWeights::default(), top)?
            .with_capacity(n_runs + 300);
        let began = Instant::now();
        for _ in 0..n_runs {
            let scale = 1.0 + 0.5 * random.signed();
            let error: Vec<f64> = input.iter().map(|u| scale * u).collect();
            law.remember(&input, &error, &[100.0 * random.signed()])?;
        }
        let filled = began.elapsed();
        let repeats = if top.is_some() { 201 } else { 7 };
        let mut next = vec![0.0; N_SAMPLES];
        let mut each = Vec::with_capacity(repeats);
        law.set_disturbance(&[100.0 * random.signed()]);
        for _ in 0..repeats {
            law.set_disturbance(&[100.0 * random.signed()]);
            let began = Instant::now();
            law.update(&input, &input, &mut next)?;
            each.push(began.elapsed());
            std::hint::black_box(&next);
        }
        each.sort();
        *time = each[repeats / 2];
        if top.is_some() {
            fastest = *time;
            println!(
                "{n_runs:>6} runs kept in {filled:.2?}, {:.1?} each; update {fastest:.1?}, slowest {:.1?}",
                filled / u32::try_from(n_runs)?,
                each[repeats - 1]
            );
        }
    }
    println!(
        "{n_runs:>6} runs kept: update from the {TOP} most relevant {:.1?}, from all {:.1?}: {:.0} times",
        times[0],
        times[1],
        times[1].as_secs_f64() / times[0].as_secs_f64()
    );
    Ok(fastest)
}
