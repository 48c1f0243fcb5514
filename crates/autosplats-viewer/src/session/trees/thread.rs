//! The thread that loads nodes.

use std::panic::{AssertUnwindSafe, catch_unwind};

use autosplats::Error;

use super::loading::Loading;
use super::mailbox::{Follower, Order, Shared, Work};
use super::{TreeOptions, Wish};

pub(super) fn run(shared: &Shared, options: &TreeOptions) {
    let mut loading = Loading::new(shared, options);
    let mut seen = 0;
    while let Some(work) = shared.next(&mut seen, loading.due_at()) {
        let worked = catch_unwind(AssertUnwindSafe(|| match work {
            Work::Wish(wish) => fulfil(&mut loading, shared, &wish, seen),
            Work::Order(order) => {
                deliver(&mut loading, shared, order);
                true
            }
        }));
        match worked {
            Ok(true) => {}
            // What an order has interrupted goes on after it.
            Ok(false) => seen = 0,
            // A panic over one octree must not end the window.
            Err(_) => {
                shared.tell(Err("loading an octree failed, which is a bug in this program".into()));
                loading = Loading::new(shared, options);
            }
        }
    }
}

/// Loads and shows what the window wishes. Returns whether nothing is left to do.
fn fulfil(loading: &mut Loading<'_>, shared: &Shared, wish: &Wish, number: u64) -> bool {
    let Some(picture) = loading.picture(wish) else { return true };
    match loading.load(&picture, &Follower::new(shared, Some(number)), true) {
        Ok(choice) => {
            loading.finish(&picture, &choice);
            true
        }
        Err(Error::Cancelled) => false,
        // The picture tells what is wrong with its camera.
        Err(_) => true,
    }
}

/// Loads what an order asks for, and replies.
fn deliver(loading: &mut Loading<'_>, shared: &Shared, Order { wish, reply }: Order) {
    let loaded = match loading.picture(&wish) {
        None => Ok(Vec::new()),
        Some(picture) => {
            loading.retry_now();
            let loaded = loading.load(&picture, &Follower::new(shared, None), false);
            let failure = picture.trees.iter().find_map(|tree| loading.failure(tree));
            match (loaded, failure) {
                (Err(error), _) => Err(error.to_string()),
                (Ok(_), Some(why)) => Err(why.to_owned()),
                (Ok(choice), None) => Ok(loading.clouds(&picture, &choice)),
            }
        }
    };
    // Who ordered may have gone.
    let _ = reply.send(loaded);
}
