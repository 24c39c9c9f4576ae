//! A load torque over time, from a file.

use motorlink_proto::time::Instant;

/// The header of a file.
const HEADER: &str = "t_s,newton_metres";

/// A torque that is linear between points, and constant before the first and after the last.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct LoadProfile {
    /// Moments in s, each later than the one before, with the torque in Nm; at least one.
    points: Vec<(f64, f64)>,
}

impl LoadProfile {
    /// Reads the text of a file.
    pub(super) fn parse(text: &str) -> Result<Self, String> {
        let mut lines = text.lines().map(str::trim).zip(1..).filter(|(line, _)| !line.is_empty());
        match lines.next() {
            Some((HEADER, _)) => {}
            _ => return Err(format!("the first line is not `{HEADER}`")),
        }
        let mut points: Vec<(f64, f64)> = Vec::new();
        for (line, number) in lines {
            let point = line.split_once(',').and_then(|(t, torque)| {
                Some((t.trim().parse::<f64>().ok()?, torque.trim().parse::<f64>().ok()?))
            });
            let (t, torque) = point
                .filter(|(t, torque)| t.is_finite() && torque.is_finite())
                .ok_or_else(|| format!("line {number}: `{line}` is not a time and a torque"))?;
            if points.last().is_some_and(|(before, _)| *before >= t) {
                return Err(format!("line {number}: {t} s is not later than the line before"));
            }
            points.push((t, torque));
        }
        if points.is_empty() {
            return Err("it has no points".to_owned());
        }
        Ok(LoadProfile { points })
    }

    /// The torques of the points, Nm.
    pub(super) fn torques(&self) -> impl Iterator<Item = f32> {
        self.points.iter().map(|(_, torque)| *torque as f32)
    }

    /// The torque at a moment, Nm.
    pub(super) fn at(&self, now: Instant) -> f32 {
        let now = now.0 as f64 / 1e6;
        let next = self.points.partition_point(|(t, _)| *t <= now);
        let torque = match (next.checked_sub(1).map(|n| self.points[n]), self.points.get(next)) {
            (Some((t0, a)), Some((t1, b))) => a + (b - a) * (now - t0) / (t1 - t0),
            (Some((_, last)), None) => last,
            (None, first) => first.map_or(0.0, |(_, torque)| *torque),
        };
        torque as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_torque_is_linear_between_points_and_constant_outside() {
        let profile = LoadProfile::parse("t_s,newton_metres\n0.5,1\n\n1.0, 3\n 1.5,-1\n").unwrap();
        let at = |ms: u64| profile.at(Instant(ms * 1000));
        assert_eq!([at(0), at(500), at(625), at(1000)], [1.0, 1.0, 1.5, 3.0]);
        assert_eq!([at(1250), at(1500), at(9000)], [1.0, -1.0, -1.0]);
        assert!(profile.torques().eq([1.0, 3.0, -1.0]));
    }

    #[test]
    fn errors_name_their_line() {
        let why = |text: &str| LoadProfile::parse(text).unwrap_err();
        assert!(why("").contains("t_s,newton_metres"));
        assert!(why("time,torque\n0,1").contains("t_s,newton_metres"));
        assert!(why("t_s,newton_metres\n").contains("no points"));
        assert!(why("t_s,newton_metres\n0,1\n0,2").contains("line 3"));
        assert!(why("t_s,newton_metres\n0;1").contains("line 2"));
        assert!(why("t_s,newton_metres\n0,nan").contains("line 2"));
        assert!(why("t_s,newton_metres\ninf,1").contains("line 2"));
    }
}
