//! Places of the readers of events, shared fairly among the addresses that they come from.

use std::net::IpAddr;
use std::sync::{Arc, Mutex, PoisonError};

use tokio::sync::oneshot;

/// Places in a bounded number. If all are taken, a new reader takes that of the oldest one of the address with the most
/// readers, unless its own address has as many: whoever opens many pages keeps nobody else out.
#[derive(Debug)]
pub(super) struct Readers {
    most: usize,
    /// Oldest first. A reader that has left no longer listens.
    places: Mutex<Vec<(IpAddr, oneshot::Sender<()>)>>,
}

/// A place, which ends when it is given to another reader.
pub(super) type Place = oneshot::Receiver<()>;

impl Readers {
    pub(super) fn new(most: usize) -> Arc<Self> {
        Arc::new(Self { most, places: Mutex::new(Vec::new()) })
    }

    /// A place for a reader; `None` if there is none.
    pub(super) fn take(&self, address: IpAddr) -> Option<Place> {
        // Nothing that a panic leaves behind is invalid.
        let mut places = self.places.lock().unwrap_or_else(PoisonError::into_inner);
        places.retain(|(_, held)| !held.is_closed());
        if places.len() >= self.most {
            let readers = |of: IpAddr| places.iter().filter(|(other, _)| *other == of).count();
            let most = places.iter().map(|(of, _)| readers(*of)).max().unwrap_or(0);
            let yielding = places.iter().position(|(of, _)| readers(*of) == most);
            let yielding = yielding.filter(|_| readers(address) < most)?;
            let _ = places.remove(yielding).1.send(());
        }
        let (held, place) = oneshot::channel();
        places.push((address, held));
        Some(place)
    }
}

#[cfg(test)]
mod tests {
    use super::Readers;

    /// 32 idle clients kept new viewers out of the page.
    #[test]
    fn whoever_opens_many_pages_keeps_nobody_else_out() {
        let [crowd, viewer, other] = [1, 2, 3].map(|n| [192, 168, 1, n].into());
        let readers = Readers::new(4);
        let mut crowded: Vec<_> = (0..4).map(|_| readers.take(crowd).unwrap()).collect();
        assert!(readers.take(crowd).is_none(), "its own places are taken");
        // The oldest one yields.
        let mut first = readers.take(viewer).unwrap();
        let ended = |places: &mut Vec<super::Place>| -> Vec<bool> {
            places.iter_mut().map(|place| place.try_recv().is_ok()).collect()
        };
        assert_eq!(ended(&mut crowded), [true, false, false, false]);
        crowded.remove(0);
        // Two and two: nobody has more than another one would have.
        let _second = readers.take(viewer).unwrap();
        assert_eq!(ended(&mut crowded), [true, false, false]);
        crowded.remove(0);
        assert!(readers.take(viewer).is_none() && readers.take(crowd).is_none());
        assert!(readers.take(other).is_some() && first.try_recv().is_err());
        // A reader that leaves gives its place back.
        drop(crowded);
        assert!(readers.take(crowd).is_some());
    }
}
