//! Fewer points of a signal: of each stretch of time the least and the greatest value, and its gaps.

/// Samples are missing where two are further apart than this many usual intervals.
const GAP: f64 = 3.0;
/// The most points of a stretch: the least, the greatest, and gaps before, between and behind them.
const OF_STRETCH: usize = 5;
/// A sample before and one after the time that is shown, each with a gap between.
const BESIDE: usize = 4;
/// Samples whose usual distance is that of all.
const INTERVALS: usize = 1000;
/// The fewest points that can be asked for.
pub const FEWEST: usize = 2 * OF_STRETCH + BESIDE;

/// A sample, or a gap.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// In seconds.
    pub t: f64,
    /// The time between request and reply, in seconds.
    pub span: f64,
    /// NaN is a gap.
    pub value: f64,
}

impl Point {
    fn gap(t: f64) -> Self {
        Point { t, span: f64::NAN, value: f64::NAN }
    }

    fn is_gap(&self) -> bool {
        self.value.is_nan()
    }
}

/// A signal in the order of its recording, of which a limited number of points is kept.
///
/// While there are few samples, all are kept. Then a stretch of time keeps its extremes: a spike of one
/// sample stays. Each gap stays, too, at least as wide as a stretch.
#[derive(Debug)]
pub struct Downsample {
    from: f64,
    to: f64,
    most: usize,
    before: Option<Point>,
    after: Option<Point>,
    /// All samples, until they are too many.
    all: Vec<Point>,
    stretches: Vec<Stretch>,
    /// Times between the first samples, to know the usual one.
    intervals: Vec<f64>,
    /// The longest time between two samples without a gap.
    longest: f64,
    seen: Option<f64>,
    /// The first and the last time of samples in stretches.
    times: Option<[f64; 2]>,
}

#[derive(Debug, Clone, Copy, Default)]
struct Stretch {
    least: Option<Point>,
    greatest: Option<Point>,
    first_gap: Option<f64>,
    last_gap: Option<f64>,
    /// A gap after the first and before the second of the two extremes.
    between: Option<f64>,
}

impl Downsample {
    /// At most `most` points between `from` and `to`, [`FEWEST`] at least.
    pub fn new(from: f64, to: f64, most: usize) -> Self {
        Downsample {
            from,
            to,
            most: most.max(FEWEST),
            before: None,
            after: None,
            all: Vec::new(),
            stretches: Vec::new(),
            intervals: Vec::new(),
            longest: f64::INFINITY,
            seen: None,
            times: None,
        }
    }

    /// Takes the next sample.
    pub fn push(&mut self, point: Point) {
        if let Some(seen) = self.seen
            && seen < point.t
            && self.intervals.len() < INTERVALS
        {
            self.intervals.push(point.t - seen);
        }
        self.seen = Some(point.t);
        if point.t < self.from {
            if self.before.is_none_or(|before| before.t <= point.t) {
                self.before = Some(point);
            }
        } else if point.t > self.to {
            if self.after.is_none_or(|after| after.t > point.t) {
                self.after = Some(point);
            }
        } else if self.stretches.is_empty() {
            self.all.push(point);
            // Half, since a gap may follow each of them.
            if self.all.len() > (self.most - BESIDE) / 2 {
                self.divide();
            }
        } else {
            self.sort_in(point);
        }
    }

    /// The points, in the order of time.
    pub fn finish(mut self) -> Vec<Point> {
        let (inside, times): (Vec<Point>, _) = match self.stretches.is_empty() {
            true => {
                self.learn();
                self.all.sort_by(|a, b| a.t.total_cmp(&b.t));
                let times = self.all.first().zip(self.all.last());
                (self.with_gaps(&self.all), times.map(|(first, last)| [first.t, last.t]))
            }
            false => (self.stretches.iter().flat_map(Stretch::points).collect(), self.times),
        };
        let mut points = Vec::with_capacity(inside.len() + BESIDE);
        let next = times.map(|[first, _]| first).or(self.after.map(|after| after.t));
        if let Some(before) = self.before {
            points.push(before);
            points.extend(next.and_then(|next| self.missing(before.t, next)));
        }
        points.extend(inside);
        if let Some(after) = self.after {
            points.extend(times.and_then(|[_, last]| self.missing(last, after.t)));
            points.push(after);
        }
        points
    }

    fn with_gaps(&self, samples: &[Point]) -> Vec<Point> {
        let gaps = samples.windows(2).map(|pair| self.missing(pair[0].t, pair[1].t));
        let gaps = gaps.chain([None]);
        samples.iter().zip(gaps).flat_map(|(sample, gap)| [Some(*sample), gap]).flatten().collect()
    }

    /// The gap between two samples, if there should be some between them.
    fn missing(&self, one: f64, other: f64) -> Option<Point> {
        (other - one > self.longest).then(|| Point::gap(one + (other - one) / 2.0))
    }

    /// Learns which time between samples is a gap.
    fn learn(&mut self) {
        let middle = self.intervals.len() / 2;
        if !self.intervals.is_empty() {
            let (_, usual, _) = self.intervals.select_nth_unstable_by(middle, f64::total_cmp);
            self.longest = GAP * *usual;
        }
    }

    /// There are too many samples to keep all.
    fn divide(&mut self) {
        self.learn();
        self.stretches = vec![Stretch::default(); (self.most - BESIDE) / OF_STRETCH];
        std::mem::take(&mut self.all).into_iter().for_each(|point| self.sort_in(point));
    }

    fn sort_in(&mut self, point: Point) {
        let last = self.times.map(|[_, last]| last);
        if let Some(gap) = last.and_then(|last| self.missing(last, point.t)) {
            self.stretch(gap.t).gap(gap.t);
        }
        let [first, last] = self.times.unwrap_or([point.t; 2]);
        self.times = Some([first.min(point.t), last.max(point.t)]);
        let stretch = self.stretch(point.t);
        match point.is_gap() {
            true => stretch.gap(point.t),
            false => stretch.take(point),
        }
    }

    fn stretch(&mut self, t: f64) -> &mut Stretch {
        let last = self.stretches.len() - 1;
        let place = (t - self.from) / (self.to - self.from) * self.stretches.len() as f64;
        &mut self.stretches[(place as usize).min(last)]
    }
}

impl Stretch {
    fn take(&mut self, point: Point) {
        let extremes = (self.least, self.greatest);
        if self.least.is_none_or(|least| point.value < least.value) {
            self.least = Some(point);
        }
        if self.greatest.is_none_or(|greatest| point.value > greatest.value) {
            self.greatest = Some(point);
        }
        if extremes != (self.least, self.greatest) {
            self.find_between();
        }
    }

    fn gap(&mut self, t: f64) {
        self.first_gap = Some(self.first_gap.map_or(t, |first| first.min(t)));
        self.last_gap = Some(self.last_gap.map_or(t, |last| last.max(t)));
    }

    /// The last gap is that before the newest extreme.
    fn find_between(&mut self) {
        let (Some(least), Some(greatest)) = (self.least, self.greatest) else { return };
        let (early, late) = (least.t.min(greatest.t), least.t.max(greatest.t));
        let is_between = |t: &f64| early < *t && *t < late;
        let known = [self.last_gap, self.between, self.first_gap];
        self.between = known.into_iter().flatten().find(is_between);
    }

    fn points(&self) -> Vec<Point> {
        let gaps = [self.first_gap, self.between, self.last_gap];
        let gaps = gaps.into_iter().flatten().map(Point::gap);
        let extremes = [self.least, self.greatest].into_iter().flatten();
        let mut points: Vec<Point> = extremes.chain(gaps).collect();
        points.sort_by(|a, b| a.t.total_cmp(&b.t));
        points.dedup_by(|a, b| a.t == b.t && (a.value == b.value || a.is_gap() && b.is_gap()));
        points
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn sample(t: f64, value: f64) -> Point {
        Point { t, span: 0.0, value }
    }

    fn downsample(samples: &[Point], from: f64, to: f64, most: usize) -> Vec<Point> {
        let mut kept = Downsample::new(from, to, most);
        samples.iter().for_each(|point| kept.push(*point));
        kept.finish()
    }

    /// Samples each 10 ms. `None` is a missing one, NaN one without a value.
    fn samples(values: &[Option<f64>]) -> Vec<Point> {
        let of = |(n, value): (usize, &Option<f64>)| value.map(|it| sample(n as f64 * 0.01, it));
        values.iter().enumerate().filter_map(of).collect()
    }

    fn valid(points: &[Point]) -> impl Iterator<Item = &Point> {
        points.iter().filter(|point| !point.is_gap())
    }

    fn values() -> impl Strategy<Value = Vec<Option<f64>>> {
        let value = prop_oneof![
            40 => (-100.0..100.0).prop_map(Some),
            2 => Just(Some(f64::NAN)),
            1 => Just(Some(1e6)),
        ];
        let run = prop_oneof![
            10 => prop::collection::vec(value, 1..60),
            1 => prop::collection::vec(Just(None), 4..80),
        ];
        let regular = prop::collection::vec((-1.0..1.0).prop_map(Some), 20);
        let runs = prop::collection::vec(run, 1..40).prop_map(|runs| runs.concat());
        (regular, runs).prop_map(|(regular, runs)| [regular, runs].concat())
    }

    proptest! {
        #[test]
        fn extremes_and_gaps_stay_and_the_number_is_limited(
            values in values(),
            most in FEWEST..400,
            from in 0.0..3.0,
            length in 0.0..30.0,
        ) {
            let all = samples(&values);
            let points = downsample(&all, from, from + length, most);
            prop_assert!(points.len() <= most, "{} of {most}", points.len());
            prop_assert!(points.is_sorted_by(|a, b| a.t < b.t), "{points:?}");
            // Each point was recorded.
            prop_assert!(valid(&points).all(|point| all.contains(point)));
            let inside: Vec<Point> =
                all.iter().copied().filter(|it| (from..=from + length).contains(&it.t)).collect();
            let extremes = |points: &[Point]| {
                let inside = valid(points).filter(|it| (from..=from + length).contains(&it.t));
                inside.fold([f64::INFINITY, -f64::INFINITY], |[least, most], point| {
                    [least.min(point.value), most.max(point.value)]
                })
            };
            prop_assert_eq!(extremes(&points), extremes(&inside));
            // Two points without a gap between have none in the recording.
            for pair in points.windows(2) {
                if pair.iter().any(Point::is_gap) {
                    continue;
                }
                let between: Vec<Point> = all
                    .iter()
                    .copied()
                    .filter(|it| (pair[0].t..=pair[1].t).contains(&it.t))
                    .collect();
                prop_assert!(!between.iter().any(Point::is_gap), "{pair:?}");
                prop_assert!(
                    between.windows(2).all(|two| two[1].t - two[0].t < 0.035),
                    "{pair:?} {between:?}"
                );
            }
        }

        #[test]
        fn a_stretch_keeps_its_own_extremes(
            values in prop::collection::vec(-100.0..100.0, 500..3000),
            spike in 0_usize..500,
        ) {
            let mut values: Vec<Option<f64>> = values.into_iter().map(Some).collect();
            values[spike] = Some(1e9);
            let all = samples(&values);
            let to = all.last().map_or(0.0, |last| last.t);
            let points = downsample(&all, 0.0, to, 504);
            let width = to / 100.0;
            for n in 0..100 {
                let of = |points: &[Point]| {
                    let values = valid(points)
                        .filter(|it| ((it.t / to * 100.0) as usize).min(99) == n)
                        .map(|it| it.value);
                    let values: Vec<f64> = values.collect();
                    let least = values.iter().copied().fold(f64::INFINITY, f64::min);
                    [least, values.iter().copied().fold(-f64::INFINITY, f64::max)]
                };
                prop_assert_eq!(of(&points), of(&all), "stretch {} of {}", n, width);
            }
        }
    }

    #[test]
    fn few_samples_are_all_given_with_one_beside_each_end() {
        let all = samples(&(0..20).map(|n| Some(f64::from(n))).collect::<Vec<_>>());
        assert_eq!(downsample(&all, 0.045, 0.105, 100), all[4..=11]);
        assert_eq!(downsample(&all, 0.051, 0.052, 100), all[5..=6]);
        assert_eq!(downsample(&[], 0.0, 1.0, 100), []);
        // A recording of one sample.
        assert_eq!(downsample(&all[..1], 0.0, 0.0, 100), all[..1]);
    }

    #[test]
    fn time_within_an_outage_is_a_gap() {
        let values: Vec<_> = (0..200).map(|n| (!(50..150).contains(&n)).then_some(1.0)).collect();
        let points = downsample(&samples(&values), 0.9, 1.1, 100);
        assert_eq!(points.len(), 3);
        assert!(points[1].is_gap() && valid(&points).count() == 2);
    }
}
