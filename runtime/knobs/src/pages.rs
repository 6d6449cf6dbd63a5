//! Pages that follow the component tree: coarse components on the first knobs, and on the others the children of whichever
//! coarse knob was turned last.
//!
//! Eight knobs, three coarse and five fine: turn the second, and its five children come onto knobs four to eight. `Next`
//! brings the next three coarse components; `Into` puts the children on the coarse knobs and theirs on the fine ones, one
//! level down; `Out` comes back. Without fine knobs the whole box shows one family at a time.

use super::map::{Command, ControlMap, TreePages};

/// What the knobs of the tree show.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct TreeView {
    /// Whose children the coarse knobs show; `None`: the coarsest components.
    pub parent: Option<u16>,
    /// The first of them shown.
    pub first: u16,
    /// Whose children the fine knobs show: the coarse component last turned.
    pub focus: Option<u16>,
    /// The first of them shown.
    pub first_fine: u16,
}

impl TreeView {
    /// Component on the knob at `slot` of the tree, coarse knobs first.
    pub(crate) fn control_at(&self, map: &ControlMap<'_>, tree: &TreePages, slot: usize) -> Option<u16> {
        let coarse = usize::from(tree.coarse_knobs);
        if slot < coarse {
            return children(map, self.parent).nth(usize::from(self.first) + slot);
        }
        let focus = self.focus?;
        children(map, Some(focus)).nth(usize::from(self.first_fine) + slot - coarse)
    }

    /// Brings the children of a component onto the fine knobs.
    pub(crate) fn focus_on(&mut self, control: u16) {
        if self.focus != Some(control) {
            (self.focus, self.first_fine) = (Some(control), 0);
        }
    }

    /// Turns pages; leaves the view alone where there is nothing to turn to.
    pub(crate) fn apply(&mut self, map: &ControlMap<'_>, tree: &TreePages, command: Command) {
        let coarse = tree.coarse_knobs;
        match command {
            Command::Next => self.first = next(self.first, coarse, count(map, self.parent)),
            Command::Previous => self.first = previous(self.first, coarse, count(map, self.parent)),
            Command::NextFine if tree.fine_knobs > 0 && self.focus.is_some() => {
                self.first_fine = next(self.first_fine, tree.fine_knobs, count(map, self.focus));
            }
            Command::Focus(control) if usize::from(control) < map.basis.component_count() => self.focus_on(control),
            Command::Into => {
                if let Some(focus) = self.focus.filter(|_| count(map, self.focus) > 0) {
                    *self = Self {
                        parent: Some(focus),
                        ..Self::default()
                    };
                }
            }
            Command::Out => {
                if let Some(child) = self.parent {
                    let parent = map.basis.component(child.into()).parent.map(|k| k as u16);
                    let place = children(map, parent).position(|k| k == child).unwrap_or(0) as u16;
                    *self = Self {
                        parent,
                        first: place / coarse * coarse,
                        focus: Some(child),
                        first_fine: 0,
                    };
                }
            }
            _ => {}
        }
    }
}

/// Children of a component, in the order of the package, without those that a binding has.
fn children<'m>(map: &ControlMap<'m>, parent: Option<u16>) -> impl Iterator<Item = u16> + use<'m> {
    let map = *map;
    let of_parent = move |k: &usize| map.basis.component(*k).parent == parent.map(usize::from);
    // The format allows 4,096 components.
    (0..map.basis.component_count())
        .filter(move |k| of_parent(k) && !map.is_bound(*k))
        .map(|k| k as u16)
}

fn count(map: &ControlMap<'_>, parent: Option<u16>) -> u16 {
    children(map, parent).count() as u16
}

fn next(first: u16, page: u16, count: u16) -> u16 {
    if first + page < count { first + page } else { 0 }
}

fn previous(first: u16, page: u16, count: u16) -> u16 {
    match first.checked_sub(page) {
        Some(earlier) => earlier,
        None if count == 0 => 0,
        None => (count - 1) / page * page,
    }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;
    use crate::fixture::{Package, open};
    use crate::map::{Binding, Knob};

    fn shown(view: &TreeView, map: &ControlMap<'_>, tree: &TreePages) -> Vec<Option<u16>> {
        (0..tree.slot_count())
            .map(|slot| view.control_at(map, tree, slot))
            .collect()
    }

    // The fixture's tree: c0 has the child c2, c1 the children c3 and c4.
    #[test]
    fn a_coarse_knob_brings_its_children() {
        let package = Package::small(1);
        let knobs: [Knob<'_>; 4] = core::array::from_fn(|n| Knob::new(n as u16, ""));
        let tree = TreePages {
            coarse_knobs: 2,
            fine_knobs: 2,
            ..TreePages::default()
        };
        let map = ControlMap::new(open(&package), &knobs, &[], &[], Some(tree)).unwrap();
        let mut view = TreeView::default();
        assert_eq!(shown(&view, &map, &tree), [Some(0), Some(1), None, None]);
        view.focus_on(1);
        assert_eq!(shown(&view, &map, &tree), [Some(0), Some(1), Some(3), Some(4)]);
        view.focus_on(0);
        assert_eq!(shown(&view, &map, &tree), [Some(0), Some(1), Some(2), None]);
        view.apply(&map, &tree, Command::Focus(1));
        view.apply(&map, &tree, Command::Into);
        assert_eq!(shown(&view, &map, &tree), [Some(3), Some(4), None, None]);
        view.apply(&map, &tree, Command::Into);
        assert_eq!(view.parent, Some(1), "leaves have nothing to go into");
        view.apply(&map, &tree, Command::Out);
        assert_eq!(shown(&view, &map, &tree), [Some(0), Some(1), Some(3), Some(4)]);
        view.apply(&map, &tree, Command::Out);
        assert_eq!(view.parent, None);
        let before = view;
        view.apply(&map, &tree, Command::Focus(u16::MAX));
        assert_eq!(view, before, "no such component");
    }

    #[test]
    fn pages_turn_round() {
        let package = Package::small(1);
        let knobs = [Knob::new(0, ""), Knob::new(1, "")];
        let tree = TreePages {
            coarse_knobs: 1,
            fine_knobs: 1,
            ..TreePages::default()
        };
        let map = ControlMap::new(open(&package), &knobs, &[], &[], Some(tree)).unwrap();
        let mut view = TreeView::default();
        let mut after = |command| {
            view.apply(&map, &tree, command);
            shown(&view, &map, &tree)
        };
        assert_eq!(after(Command::Next), [Some(1), None]);
        assert_eq!(after(Command::Next), [Some(0), None]);
        assert_eq!(after(Command::Previous), [Some(1), None]);
        assert_eq!(after(Command::Previous), [Some(0), None]);
        assert_eq!(after(Command::Focus(1)), [Some(0), Some(3)]);
        assert_eq!(after(Command::NextFine), [Some(0), Some(4)]);
        assert_eq!(after(Command::NextFine), [Some(0), Some(3)]);
        let out = {
            after(Command::Into);
            after(Command::Out)
        };
        assert_eq!(out, [Some(1), Some(3)], "back on the page of the parent");
    }

    #[test]
    fn what_a_binding_has_the_tree_leaves_out() {
        let package = Package::small(1);
        let knobs = [Knob::new(0, ""), Knob::new(1, "")];
        let tree = TreePages {
            first_knob: 1,
            coarse_knobs: 1,
            fine_knobs: 0,
            ..TreePages::default()
        };
        let own = [Binding::default()];
        let map = ControlMap::new(open(&package), &knobs, &own, &[], Some(tree)).unwrap();
        assert_eq!(shown(&TreeView::default(), &map, &tree), [Some(1)]);
        assert_eq!(previous(0, 3, 0), 0);
    }
}
