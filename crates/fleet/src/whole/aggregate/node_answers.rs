//! The answers of nodes.

use super::*;

impl Aggregate {
    pub(super) fn answered(&mut self, node: &Name, id: u32, result: Result<Answer, Refusal>) {
        let Some(Asked { of, wall, .. }) = self.asked.remove(&id) else { return };
        if let Ok(Answer::Lines { lines, latched_by }) = &result {
            let before = self.learn(node, lines, latched_by.clone(), wall);
            if let RequestPurpose::Released(number) = of
                && latched_by.is_none()
                && self.latches.number() == Some(number)
            {
                self.latches.clear();
            }
            if matches!(of, RequestPurpose::Lines) {
                self.tell_lines(node, &before, lines);
            }
        }
        if let (RequestPurpose::Round(_) | RequestPurpose::Nothing, Ok(Answer::Stop { .. })) =
            (&of, &result)
        {
            self.stopped.insert(node.clone());
        }
        let new = match (&of, &result) {
            (RequestPurpose::Again(number), Ok(Answer::Subscribe { subscription })) => {
                Some((*number, *subscription))
            }
            (RequestPurpose::Round(round), Ok(Answer::Subscribe { subscription })) => {
                match self.rounds.get(round).map(|it| it.kind) {
                    Some(RoundKind::Subscribe(number)) => Some((number, *subscription)),
                    _ => None,
                }
            }
            _ => None,
        };
        if let Some((ours, theirs)) = new {
            match self.members.get_mut(node) {
                Some(member) if self.subscriptions.contains_key(&ours) => {
                    member.subscriptions.insert(theirs, ours);
                }
                // It was ended meanwhile.
                _ => self.ask(
                    node,
                    Ask::Unsubscribe { subscription: theirs },
                    RequestPurpose::Nothing,
                ),
            }
        }
        self.ended(node, of, result);
    }

    /// Ends what a node was asked for.
    pub(super) fn ended(
        &mut self,
        node: &Name,
        of: RequestPurpose,
        result: Result<Answer, Refusal>,
    ) {
        match of {
            RequestPurpose::One(id, line) => {
                let result = result.map(|answer| names::answer(node, answer));
                let named = |why| names::refusal(node, line.as_deref(), why);
                self.end(id, result.map_err(named));
            }
            RequestPurpose::Round(number) => {
                let Some(round) = self.rounds.get_mut(&number) else { return };
                round.waits.remove(node);
                round.done.insert(node.clone(), result);
                self.finish(number);
            }
            RequestPurpose::Lines
            | RequestPurpose::Released(_)
            | RequestPurpose::Again(_)
            | RequestPurpose::Nothing => {}
        }
    }

    /// Remembers the lines of a node, which was asked for them at this time of the wall clock. Gives those
    /// before.
    pub(super) fn learn(
        &mut self,
        node: &Name,
        lines: &[Line],
        latched_by: Option<String>,
        asked: f64,
    ) -> Vec<Line> {
        let Some(member) = self.members.get_mut(node) else { return Vec::new() };
        member.latched_by = latched_by;
        member.learn(lines, asked, self.wall)
    }

    /// Tells the program what is new at a node that was just connected.
    pub(super) fn tell_lines(&mut self, node: &Name, before: &[Line], lines: &[Line]) {
        let is_in = |lines: &[Line], line: &Line| {
            lines.iter().any(|it| it.line == line.line && it.protocol == line.protocol)
        };
        for line in before.iter().filter(|line| !is_in(lines, line)) {
            let message = format!("node {node} has no such line any more");
            self.tell(node, EventKind::Closed, &line.line, message);
        }
        for line in lines {
            let (event, words) = match is_in(before, line) {
                true => (EventKind::Back, "is there again"),
                false => (EventKind::Opened, "is there"),
            };
            self.tell(node, event, &line.line, format!("node {node} {words}"));
        }
    }
}
