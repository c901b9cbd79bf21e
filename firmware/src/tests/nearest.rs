//! Searches for the nearest word, while a program runs and while the console is used.

use core::cell::RefCell;

use darm_core::nearest::{Coordinates, Found};
use darm_core::sequencer::{Command, Phase};
use darm_core::table::Record;
use darm_core::wire::frame::{self, Header, MAX_FRAME, MAX_PAYLOAD};
use darm_core::wire::message::{Answer, REQUEST, Refusal, Request};
use embassy_futures::select::select;
use embassy_futures::yield_now;

use super::fakes::{run, table_with};
use super::{LINK, loaded};
use crate::app::serve;
use crate::pipe::{Pipe, PipeReader, PipeWriter};

pub(super) fn along(x: f32, y: f32) -> Coordinates {
    Coordinates { turn_rad: [0.0; 3], position_m: [x, y, 0.0] }
}

/// Two modules of one actuator: the first reaches 1 or 2 m along x, the second 1 or 3 m along y.
fn two_modules() -> [Record; 6] {
    let module = |behind| Record::Module { actuators: 1, length_scale_m: 0.5, behind };
    let frame = |digits, pose| Record::Frame { digits, pose };
    let [first, second] = [module(along(0.0, 2.0)), module(along(0.0, 0.0))];
    let [right, left] = [
        [frame(0, along(1.0, 0.0)), frame(1, along(2.0, 0.0))],
        [1.0, 3.0].map(|y| frame(u16::from(y > 2.0), along(0.0, y))),
    ];
    [first, right[0].clone(), right[1].clone(), second, left[0].clone(), left[1].clone()]
}

#[test]
fn the_board_answers_which_word_is_nearest_while_a_program_runs() {
    let bench = loaded();
    let ask = |x, y| bench.ask(Request::Nearest(along(x, y)));
    assert_eq!(ask(2.0, 1.0), Err(Refusal::NoFrames));
    bench.upload(&table_with(3, 10, false, &two_modules())).unwrap();
    bench.command(Command::Play).unwrap();
    let found = |word: &str, distance_m| {
        let word = word.parse().unwrap();
        Ok(Answer::Nearest(Found { word, distance_m, error_m: distance_m, error_rad: 0.0 }))
    };
    assert_eq!(ask(2.0, 1.0), found("10", 0.0));
    assert_eq!(ask(1.0, 3.5), found("01", 0.5));
    assert_eq!(ask(f32::NAN, 0.0), Err(Refusal::NoPose));
    assert_eq!(bench.type_line("nearest 2250 3000 0"), "11: 250.0 mm and 0.00 deg off, d 250.0 mm\r\n");
    assert!(bench.type_line("nearest 1e9 0 0").starts_with("? the pose has a number"));
    assert!(matches!(bench.status().phase, Phase::Playing { .. }));
}

#[test]
fn the_console_is_heard_while_the_board_searches() {
    let bench = loaded();
    bench.upload(&table_with(3, 10, false, &two_modules())).unwrap();
    let (input, output) = (Pipe::<1024>::new(), Pipe::<1024>::new());
    let asked = |number: u16, request: Request| {
        let (mut payload, mut frame) = ([0; MAX_PAYLOAD], [0; MAX_FRAME]);
        let payload = postcard::to_slice(&request, &mut payload).unwrap();
        let len = frame::encode(Header { tag: REQUEST, link: LINK, number }, payload, &mut frame).unwrap();
        assert_eq!(input.push_slice(&frame[..len]), len);
    };
    // The second copy of a request does not make the search begin again.
    [500, 500].into_iter().for_each(|number| asked(number, Request::Nearest(along(2.0, 1.0))));
    asked(501, Request::Status);
    let mut dispatcher = bench.dispatcher.borrow_mut();
    let (mut reader, mut writer) = (PipeReader(&input), PipeWriter(&output));
    let served = serve(dispatcher.as_mut().unwrap(), &mut reader, &mut writer);
    let numbers = RefCell::new(vec![]);
    let mut bytes = vec![];
    let heard = async {
        while numbers.borrow().len() < 2 {
            bytes.extend(core::iter::from_fn(|| output.pop()));
            for frame in core::mem::take(&mut bytes).split_inclusive(|byte| *byte == 0) {
                match frame {
                    [0] => {}
                    [encoded @ .., 0] => {
                        let number = frame::decode(&mut encoded.to_vec()).unwrap().0.number;
                        numbers.borrow_mut().push(number);
                    }
                    rest => bytes.extend_from_slice(rest),
                }
            }
            yield_now().await;
        }
    };
    run(select(served, heard), || bench.tick());
    assert_eq!(*numbers.borrow(), [501, 500]);
}
