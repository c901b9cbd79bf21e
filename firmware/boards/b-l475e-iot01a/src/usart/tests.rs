//! The ports against the models of USART and DMA controller. Sections are those of RM0351.

use darm_firmware::servo::echo::Wire;
use embassy_futures::block_on;
use embedded_io_async::{Read as _, Write as _};
use stm32_metapac::{USART1, USART2};

use super::{Line, LineErrors, Port, Reception};
use crate::dma::Channel;
use crate::tests::model::{self, Crystal, rcc, usart};
use crate::{bus, clocks};

const CONSOLE: Line = Line { baud: 115_200, is_half_duplex: false, reception: Reception::Dma };
const BUS: Line = Line { baud: 1_000_000, is_half_duplex: true, reception: Reception::Dma };
type TestPort = Port<256, 64>;

/// The board's clocks, and a port of one of its USARTs: 0 is USART1.
fn start(usart: usize, line: Line) -> &'static TestPort {
    model::power_on();
    assert_eq!(clocks::start(), Ok(()));
    let port = Box::leak(Box::new(TestPort::new([USART1, USART2][usart], [Channel::Usart1, Channel::Usart2][usart])));
    let _halves = port.start(line);
    port
}

/// Lets time pass, and calls the handler when one of the two interrupts is requested: each of these steps later.
fn run(port: &TestPort, usart: usize, us: u64, step_us: u64) {
    for _ in 0..us / step_us {
        model::pass_us(step_us);
        while model::with(|chip| chip.dma.is_pending(5 + usart)) {
            port.on_dma_interrupt();
        }
        while model::with(|chip| chip.usarts[usart].is_pending()) {
            port.on_interrupt();
        }
    }
}

fn hear(usart: usize, baud: f64, bytes: &[u8]) {
    model::with(|chip| chip.usarts[usart].hear(chip.now_ns, baud, bytes));
}

fn received(port: &TestPort) -> Vec<u8> {
    std::iter::from_fn(|| port.received.pop()).collect()
}

fn counting(count: u32) -> Vec<u8> {
    (0..count).map(|i| i as u8).collect()
}

/// 40.5.4: the rates are those of the manual's equation at the clock that the start has set.
#[test]
fn the_rates_are_met_within_a_tenth_of_a_percent() {
    for (usart, line) in [(0, CONSOLE), (1, BUS)] {
        start(usart, line);
        let baud = model::with(|chip| chip.usarts[usart].baud());
        assert!((baud / f64::from(line.baud) - 1.0).abs() < 1e-3, "{baud}");
    }
}

/// 40.5.15 and 40.5.3 "Idle character detection".
#[test]
fn what_comes_is_there_one_frame_after_the_last_byte() {
    let port = start(0, CONSOLE);
    hear(0, 115_200.0, b"stop\r");
    run(port, 0, 5 * 87, 1);
    assert!(received(port).is_empty(), "neither middle nor end of the ring, and the line is not idle yet");
    run(port, 0, 90, 1);
    assert_eq!(received(port), b"stop\r");
}

/// 40.5.15: DMA takes each byte from the register.
#[test]
fn a_stream_at_1_mbaud_survives_ticks_of_200_us() {
    let port = start(1, BUS);
    for _ in 0..20 {
        hear(1, 1e6, &counting(200));
        run(port, 1, 2_200, 200);
        assert_eq!(received(port), counting(200));
    }
    assert_eq!(port.errors(), LineErrors::default());
}

/// The same without DMA: the register is overwritten at the second byte (40.5.3 "Overrun error").
#[test]
fn without_dma_the_same_stream_overruns() {
    let port = start(1, Line { reception: Reception::Interrupts, ..BUS });
    hear(1, 1e6, &counting(200));
    run(port, 1, 2_200, 200);
    assert!(received(port).len() < 20 && port.errors().overruns > 0);
}

/// 11.6.1: half and end of the ring are flags, which do not count.
#[test]
fn a_core_that_is_away_for_a_ring_loses_it_and_says_so() {
    let port = start(1, BUS);
    hear(1, 1e6, &counting(64));
    model::pass_us(2_000);
    hear(1, 1e6, &counting(16));
    model::pass_us(2_000);
    run(port, 1, 1_000, 1);
    assert!(received(port).is_empty() && port.errors().dropped >= 64);
    hear(1, 1e6, b"again");
    run(port, 1, 1_000, 1);
    assert_eq!(received(port), b"again");
}

/// 40.5.3: each byte has to be taken from the register, whether there is room for it or not.
#[test]
fn a_full_queue_drops_what_is_new_and_counts_it() {
    let port = start(0, CONSOLE);
    hear(0, 115_200.0, &counting(300));
    run(port, 0, 40_000, 10);
    assert_eq!(received(port), counting(255));
    assert_eq!(port.errors(), LineErrors { dropped: 45, ..LineErrors::default() });
}

/// 40.8.8: FE, NF, PE and ORE, each counted once and cleared by ICR (40.8.9). The bytes around them arrive.
#[test]
fn each_error_of_the_line_is_counted_and_cleared() {
    for (flags, expected) in [
        (usart::FE, LineErrors { framing: 1, ..LineErrors::default() }),
        (usart::NF, LineErrors { noise: 1, ..LineErrors::default() }),
        (usart::PE, LineErrors::default()),
        (usart::ORE, LineErrors { overruns: 1, ..LineErrors::default() }),
    ] {
        let port = start(0, CONSOLE);
        hear(0, 115_200.0, b"a");
        model::with(|chip| chip.usarts[0].hear_with(chip.now_ns, 115_200.0, b'b', flags));
        hear(0, 115_200.0, b"c");
        run(port, 0, 1_000, 1);
        assert_eq!((received(port), port.errors()), (b"abc".to_vec(), expected));
        assert_eq!(bus::read(USART1.isr()).0 & (flags | usart::IDLE | usart::RXNE), 0);
    }
}

/// 40.5.5: another rate is a framing error of each byte, and no interrupt storm.
#[test]
fn a_host_at_another_rate_is_seen_as_framing_errors() {
    let port = start(0, CONSOLE);
    hear(0, 57_600.0, b"hello");
    run(port, 0, 2_000, 1);
    assert_eq!(port.errors().framing, 5);
}

/// 40.5.5: the receiver takes 3.75 %. The HSI16, the fallback, stays within; the MSI alone need not.
#[test]
fn the_console_works_on_the_fallback_and_not_on_an_msi_that_is_5_percent_off() {
    let port = start(0, CONSOLE);
    model::with(|chip| chip.rcc.crystal = Crystal::Dead);
    hear(0, 115_200.0 * 1.02, b"ok");
    hear(0, 115_200.0 * 1.05, b"no");
    run(port, 0, 2_000, 1);
    assert_eq!((&received(port)[..2], port.errors().framing), (&b"ok"[..], 2));
    model::with(|chip| chip.rcc.reset(rcc::BORRSTF));
}

/// 11.4.7: a bus error disables the channel; it runs again, and what comes then arrives.
#[test]
fn a_channel_that_fails_is_started_again() {
    let port = start(0, CONSOLE);
    hear(0, 115_200.0, b"lost");
    model::pass_us(200);
    model::with(|chip| chip.dma.fail(5));
    run(port, 0, 1_000, 1);
    received(port);
    hear(0, 115_200.0, b"stop\r");
    run(port, 0, 1_000, 1);
    assert_eq!((received(port), port.errors().dma), (b"stop\r".to_vec(), 1));
}

/// 40.5.12: the receiver stays open and hears what is sent; the echo is dropped above, and the answer behind it passes, however
/// early it comes.
#[test]
fn on_one_wire_the_echo_is_dropped_and_the_answer_passes() {
    model::power_on();
    assert_eq!(clocks::start(), Ok(()));
    let port: &'static TestPort = Box::leak(Box::new(TestPort::new(USART2, Channel::Usart2)));
    let (receiver, sender) = port.start(BUS);
    let wire = Wire::default();
    let (mut ear, mut mouth) = wire.split(receiver, sender);
    let (request, answer) = (*b"\xff\xff\x01\x04\x02\x38\x06\xba", b"\xff\xff\x01\x02\x00\xfc");
    block_on(mouth.write_all(&request)).expect("the port takes it");
    run(port, 1, 79, 1);
    hear(1, 1e6, answer);
    run(port, 1, 200, 1);
    let mut bytes = [0; 16];
    let n = block_on(ear.read(&mut bytes)).expect("the port gives it");
    assert_eq!(&bytes[..n], answer);
    assert_eq!(port.errors(), LineErrors::default());
}

/// 40.5.2: TC, not TXE, says that the last stop bit has left.
#[test]
fn a_flush_waits_for_the_last_stop_bit() {
    model::power_on();
    assert_eq!(clocks::start(), Ok(()));
    let port: &'static TestPort = Box::leak(Box::new(TestPort::new(USART1, Channel::Usart1)));
    let (_, mut sender) = port.start(CONSOLE);
    let began_ns = model::with(|chip| chip.now_ns);
    block_on(sender.write_all(b"ok\r\n")).expect("the port takes it");
    let mut flush = core::pin::pin!(sender.flush());
    let waker = core::task::Waker::noop();
    while flush.as_mut().poll(&mut core::task::Context::from_waker(waker)).is_pending() {
        run(port, 0, 1, 1);
    }
    let (now_ns, sent) = model::with(|chip| (chip.now_ns, chip.usarts[0].sent.clone()));
    assert_eq!(sent.iter().map(|(byte, _)| *byte).collect::<Vec<u8>>(), b"ok\r\n");
    let (_, last_ns) = sent[3];
    assert!(now_ns >= last_ns && last_ns - began_ns >= 4 * 86_800, "40 bits at 115 200 baud");
}

#[test]
#[should_panic(expected = "while UE is clear (40.8.3)")]
fn the_model_refuses_half_duplex_on_a_running_usart() {
    start(0, CONSOLE);
    bus::modify(USART1.cr3(), |w| w.set_hdsel(true));
}

#[test]
#[should_panic(expected = "while UE is clear (40.8.4)")]
fn the_model_refuses_another_rate_on_a_running_usart() {
    start(0, CONSOLE);
    bus::write(USART1.brr(), |w| w.0 = 100);
}

/// 40.5.2: TXE says when the register is empty.
#[test]
#[should_panic(expected = "a byte over one that has not left")]
fn the_model_refuses_a_byte_over_one_that_waits() {
    start(0, CONSOLE);
    for byte in b"abc" {
        bus::write(USART1.tdr(), |w| w.0 = u32::from(*byte));
    }
}

#[test]
#[should_panic(expected = "while it is disabled (11.6.3")]
fn the_model_refuses_to_set_up_a_running_channel() {
    start(0, CONSOLE);
    bus::write(stm32_metapac::DMA1.ch(4).ndtr(), |w| w.set_ndt(1));
}
