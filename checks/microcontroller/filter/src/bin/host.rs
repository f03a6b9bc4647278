//! The same steps on the host: `host CELLS GROUP SAMPLES` prints the bits of the comparison.

use hydroid_microcontroller::Learner;

fn main() {
    let mut numbers = std::env::args().skip(1).map(|text| text.parse::<usize>().expect("a number"));
    let mut next = || numbers.next().expect("CELLS GROUP SAMPLES");
    let mut learner = Learner::new(next(), next()).expect("options of the filter");
    (0..next()).for_each(|_| learner.step());
    println!("{:?}", learner.check());
}
