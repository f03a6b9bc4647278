//! Sizes of recurrent networks, and the layout of their weights.

use std::ops::Range;

use hydroid_core::model::recurrent::{Cell, Layout, Network, NetworkError, Tensor};

#[test]
fn weights_and_states_are_counted() {
    let lstm = Cell::Lstm { hidden: 18, projection: Some(3) };
    let gru = Cell::Gru { hidden: 18 };
    let vanilla = Cell::Vanilla { hidden: 18, layers: 2 };
    for (cell, read_out, weights, state) in
        [(lstm, false, 558, 21), (gru, true, 1245, 18), (vanilla, true, 1137, 36)]
    {
        let network = Network { cell, inputs: 2, outputs: 3, read_out };
        assert_eq!(network.check(), Ok(()));
        assert_eq!((network.weights(), network.state_len()), (weights, state));
    }
}

#[test]
fn impossible_networks_are_refused() {
    let network = |cell, read_out| Network { cell, inputs: 2, outputs: 3, read_out }.check();
    assert_eq!(network(Cell::Gru { hidden: 0 }, true), Err(NetworkError::Empty("cells")));
    assert_eq!(network(Cell::Gru { hidden: 5000 }, true), Err(NetworkError::Huge("cells", 5000, 4096)));
    assert_eq!(network(Cell::Gru { hidden: 5 }, false), Err(NetworkError::Shown { shown: 5, outputs: 3 }));
    let lstm = Cell::Lstm { hidden: 4, projection: Some(4) };
    assert_eq!(network(lstm, true), Err(NetworkError::Projection { hidden: 4, projection: 4 }));
}

#[test]
fn gates_are_the_rows_of_sigmoids() {
    let lstm = Network {
        cell: Cell::Lstm { hidden: 2, projection: Some(1) },
        inputs: 1,
        outputs: 1,
        read_out: false,
    };
    // W_ih 8 x 1, W_hh 8 x 1, two biases of 8; g is the third pair of rows.
    let g = |at: &usize| matches!(at % 8, 4 | 5);
    let mut gates = Layout::new(&lstm).gates(lstm.cell);
    gates.sort_unstable();
    let expected: Vec<usize> = (0..32).filter(|at| !g(at)).collect();
    assert_eq!(gates, expected);
    let gru = Network { cell: Cell::Gru { hidden: 2 }, inputs: 1, outputs: 1, read_out: true };
    // W_ih 6 x 1, W_hh 6 x 2, two biases of 6; n is the last third of each.
    let mut gates = Layout::new(&gru).gates(gru.cell);
    gates.sort_unstable();
    let expected: Vec<usize> = (0..4).chain(6..14).chain(18..22).chain(24..28).collect();
    assert_eq!(gates, expected);
    let vanilla =
        Network { cell: Cell::Vanilla { hidden: 2, layers: 2 }, inputs: 1, outputs: 1, read_out: true };
    assert!(Layout::new(&vanilla).gates(vanilla.cell).is_empty());
}

/// The layout (offsets) agrees with the tensors (names).
#[test]
fn offsets_are_those_of_the_tensors() {
    for cell in [
        Cell::Lstm { hidden: 5, projection: Some(2) },
        Cell::Lstm { hidden: 5, projection: None },
        Cell::Gru { hidden: 4 },
        Cell::Vanilla { hidden: 3, layers: 3 },
    ] {
        let network = Network { cell, inputs: 2, outputs: 2, read_out: true };
        let layout = Layout::new(&network);
        let mut places: Vec<Range<usize>> = Vec::new();
        for layer in layout.layers {
            places.extend([layer.weight_ih, layer.weight_hh, layer.bias_ih, layer.bias_hh]);
        }
        places.extend(layout.projection);
        places.extend(layout.read_out.into_iter().flat_map(|(weight, bias)| [weight, bias]));
        let tensors: Vec<Range<usize>> = network.tensors().iter().map(Tensor::range).collect();
        assert_eq!(places, tensors);
    }
}
