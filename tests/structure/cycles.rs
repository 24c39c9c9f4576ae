//! Modules that depend on each other, and the names that cause it.

use crate::modules::{Id, Modules};
use crate::names::Name;
use petgraph::algo::{astar, tarjan_scc};
use petgraph::graph::{DiGraph, NodeIndex};
use std::collections::BTreeSet;
use std::path::Path;

/// The largest sets of nodes in which every node reaches every other one.
pub fn cycles(edges: impl Iterator<Item = (usize, usize)>) -> Vec<BTreeSet<usize>> {
    let edges = edges.map(|(from, to)| (from as u32, to as u32));
    let sets = tarjan_scc(&DiGraph::<(), ()>::from_edges(edges));
    let sets = sets.into_iter().filter(|set| set.len() > 1);
    sets.map(|set| set.into_iter().map(NodeIndex::index).collect()).collect()
}

/// Modules that depend on each other.
pub struct Cycle<'a> {
    modules: &'a Modules,
    pub members: BTreeSet<Id>,
    /// A few names whose removal ends the cycle, each with the shortest way back.
    names: Vec<(&'a Name, Vec<&'a Name>)>,
}

/// The cycles of a crate's modules.
pub fn of_modules<'a>(modules: &'a Modules, names: &'a [Name]) -> Vec<Cycle<'a>> {
    let found = cycles(names.iter().map(ends)).into_iter().map(|members| {
        let inside = |name: &&Name| members.contains(&name.from) && members.contains(&name.to);
        let inside: Vec<&Name> = names.iter().filter(inside).collect();
        let names = closing(&inside).into_iter().map(|name| (name, way_back(&inside, name)));
        let names = names.collect();
        Cycle { modules, members, names }
    });
    found.collect()
}

fn ends(name: &Name) -> (Id, Id) {
    (name.from, name.to)
}

/// Names whose removal ends the cycle. Names of few items are preferred, because moving an item
/// changes all names of it.
fn closing<'a>(names: &[&'a Name]) -> Vec<&'a Name> {
    let item = |name: &Name| (name.to, name.item.clone());
    let without = |names: &[&'a Name], items: &[(Id, String)]| {
        let rest = names.iter().copied().filter(|name| !items.contains(&item(name)));
        rest.collect::<Vec<_>>()
    };
    let cyclic = |names: &[&Name]| -> usize {
        cycles(names.iter().map(|name| ends(name))).iter().map(BTreeSet::len).sum()
    };
    let mut items = Vec::new();
    let mut rest = names.to_vec();
    while cyclic(&rest) > 0 {
        let candidates: BTreeSet<_> = rest.iter().map(|name| item(name)).collect();
        let best = candidates.into_iter().min_by_key(|candidate| {
            let uses = rest.iter().filter(|name| item(name) == *candidate);
            // The number of names to remove until no such dependency remains.
            let beside = uses.map(|name| rest.iter().filter(|o| ends(o) == ends(name)).count());
            (cyclic(&without(&rest, std::slice::from_ref(candidate))), beside.sum::<usize>())
        });
        items.extend(best);
        rest = without(names, &items);
    }
    for item in items.clone() {
        let fewer: Vec<_> = items.iter().filter(|other| **other != item).cloned().collect();
        if cyclic(&without(names, &fewer)) == 0 {
            items = fewer;
        }
    }
    names.iter().copied().filter(|name| items.contains(&item(name))).collect()
}

/// A name for every step from the module that defines an item to the one that names it.
fn way_back<'a>(names: &[&'a Name], name: &Name) -> Vec<&'a Name> {
    // Of several edges, the graph finds the last one.
    let edges = names.iter().rev().map(|&name| (name.from as u32, name.to as u32, name));
    let graph = DiGraph::<(), &Name>::from_edges(edges);
    let (start, goal) = (NodeIndex::new(name.to), NodeIndex::new(name.from));
    let (_, nodes) = astar(&graph, start, |node| node == goal, |_| 1, |_| 0).unwrap_or_default();
    let steps = nodes.windows(2).filter_map(|step| graph.find_edge(step[0], step[1]));
    steps.map(|edge| graph[edge]).collect()
}

impl Cycle<'_> {
    /// The facts needed to break the cycle. Paths start at `folder`.
    pub fn report(&self, folder: &Path) -> String {
        let sentence = |name: &Name| {
            let file = &self.modules.0[name.from].file;
            let file = file.strip_prefix(folder).unwrap_or(file).display();
            let Name { item, line, .. } = name;
            format!("{file} names {}::{item} (line {line})\n", self.modules.0[name.to].name)
        };
        let mut report = format!("{} modules depend on each other:\n", self.members.len());
        for &member in &self.members {
            report += &format!("  {}\n", self.modules.0[member].name);
        }
        report += "The cycle ends without these names:\n";
        for (name, way_back) in &self.names {
            report += &format!("  {}", sentence(name));
            for name in way_back {
                report += &format!("    while {}", sentence(name));
            }
        }
        report
    }
}
