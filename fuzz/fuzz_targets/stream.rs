//! A live stream on arbitrary bytes: `cargo +nightly fuzz run stream`. The first byte says whether the header
//! is given, so that lines are reached; whatever comes, a line has one answer at the most, and it is JSON.
#![no_main]

use std::sync::Arc;

use hydroid_live::stream::{Lines, Options, Stream};
use hydroid::adapt::{self, adapter};
use hydroid::evaluate::DesignRange;
use hydroid::log::{Channel, ChannelSpec};
use hydroid::model::{Body, Description, Members, Model, Port, Provenance, Reading};
use hydroid_core::model::sparse::{Equations, Term};

fn model() -> Model {
    let terms = vec![Term::signed_square(0, 0), Term::monomial(&[1])];
    let port = |name: &str| Port {
        channel: Channel::new(name, ""),
        range: DesignRange { low: -2.0, high: 2.0 },
        training_range: None,
        noise: None,
        rate_limit: None,
    };
    let mut reading = Reading::default();
    reading.selection.outputs = vec![ChannelSpec::named("u")];
    reading.selection.inputs = vec![ChannelSpec::named("n")];
    Model {
        description: Description {
            name: String::from("fuzz"),
            dt: 0.1,
            outputs: vec![port("u")],
            inputs: vec![port("n")],
            reading,
            provenance: Provenance {
                hydroid: String::new(),
                seed: 0,
                training: Vec::new(),
                validation: Vec::new(),
                settings: Default::default(),
            },
            bands: None,
 current: None,
        },
        body: Body::Equations(Arc::new(Equations::new(terms, vec![-0.3, 0.5], 1, 1, 0.1, 1).unwrap())),
        members: Members::default(),
        learning: None,
    }
}

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Some((first, bytes)) = bytes.split_first() else { return };
    let header: &[u8] = match first % 3 {
        0 => b"",
        1 => b"t,u,n\n",
        _ => b"{\"t\":0,\"u\":0,\"n\":0}\n",
    };
    let model = model();
    let (adapter, _) = adapter(&model, &adapt::Options::default(), &[]).unwrap();
    let options = Options {
        name: String::from("fuzz"),
        reading: model.description.reading.clone(),
        horizons: vec![1, 3],
        timing: false,
    };
    let mut stream = Stream::new(&model, adapter, options).unwrap();
    let all = [header, bytes].concat();
    let mut lines = Lines::new(&all[..]);
    while let Some(line) = lines.next_line().unwrap() {
        let mut answer = Vec::new();
        if stream.serve(line, &mut answer).is_err() {
            return;
        }
        assert!(answer.is_empty() || answer.starts_with(b"{") && answer.ends_with(b"}\n"));
    }
});
