//! The only user of the client: asks the board again and again, and sends what pages order, one after the other.

mod observer;
mod supply;

use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

use darm_arm::table_file::{self, TableFile};
use darm_core::sequencer::Command;
use darm_core::units::Digest;
use darm_core::wire::message::Refusal;
use darm_device::client::sharing::Rights;
use darm_device::client::{Client, ClientError};
use darm_device::link::LinkError;

use crate::board_port::Opener;
use crate::history::TableEntry;
use crate::hub::Hub;
use crate::order::{Order, Task};
use crate::program::Program;
use crate::refusal::{Kind, Refused};
use crate::unix_time;
use crate::view::UploadView;
use observer::Observer;

/// Interval of the questions.
const QUESTION_PERIOD: Duration = Duration::from_millis(50);
/// A lost port is opened again after this time.
const REOPEN_PORT_AFTER: Duration = Duration::from_millis(500);

/// Asks the board, and sends it what pages order.
pub(crate) struct Watcher {
    hub: Arc<Hub>,
    open: Opener,
    orders: Receiver<Order>,
    /// Number of stops before the connection was opened: after another one the board takes no command from it. `None` where
    /// the board has ended it for another reason.
    stops_at_hello: Option<u64>,
    /// When the connection was opened: what was ordered before that is not sent, as whoever ended the one before may have stopped the arm.
    opened: Instant,
    /// A page has gone with its control, and what it moved by hand is not known to rest.
    is_abandoned: bool,
    /// Whether something is driven by hand, as far as is known: the board said so last, or has been asked to since.
    is_by_hand: bool,
}

impl Watcher {
    pub(crate) fn new(hub: Arc<Hub>, open: Opener, orders: Receiver<Order>) -> Self {
        Self { hub, open, orders, stops_at_hello: None, opened: Instant::now(), is_abandoned: false, is_by_hand: false }
    }

    /// Runs until the server ends.
    pub(crate) fn run(mut self) {
        while !self.hub.has_ended() {
            let lost = match self.connect() {
                Ok(mut client) => self.follow(&mut client),
                Err(error) => error,
            };
            self.hub.set_lost(lost.to_string());
            self.refuse_orders(Instant::now() + REOPEN_PORT_AFTER);
        }
        self.switch_off();
    }

    /// As when the page in control goes away: nobody is left who would switch off what it drives by hand.
    fn switch_off(&mut self) {
        self.is_by_hand = self.is_by_hand && !self.hub.stops().send_confirmed();
    }

    fn connect(&mut self) -> Result<Client, ClientError> {
        let (link, handle) = (self.open)()?;
        self.hub.set_port_open(link.name(), handle.clone());
        let stops = self.hub.stops().count();
        let mut client = Client::connect(link)?;
        let hub = Arc::clone(&self.hub);
        client.set_on_text(move |text| hub.hear_text(text));
        let rights: Arc<dyn Rights> = Arc::clone(&self.hub) as _;
        client.share(&handle, rights);
        (self.stops_at_hello, self.opened) = (Some(stops), Instant::now());
        Ok(client)
    }

    /// Asks and sends until the port is lost; why it was.
    fn follow(&mut self, client: &mut Client) -> ClientError {
        let mut observer = Observer::new(Arc::clone(&self.hub), client);
        loop {
            let due = Instant::now() + QUESTION_PERIOD;
            // Before the look: it sees what the page has ordered last.
            self.is_abandoned |= self.hub.take_abandoned();
            match observer.look(client) {
                Err(ClientError::Refused(Refusal::NotConnected)) => match self.say_hello(client) {
                    Ok(()) => observer = Observer::new(Arc::clone(&self.hub), client),
                    Err(error) => return error,
                },
                Err(error) => return error,
                Ok(()) => self.is_by_hand = self.hub.is_by_hand(),
            }
            if self.is_abandoned {
                self.switch_off();
                self.is_abandoned = self.is_by_hand;
            }
            // At once after a stop of a page: what is ordered until then is refused.
            if let Err(error) = self.open_again(client) {
                return error;
            }
            while let Some(order) = self.next_order(due) {
                self.execute(client, order);
            }
            if self.hub.has_ended() {
                self.switch_off();
                return LinkError::Closed { port: client.port().to_owned() }.into();
            }
        }
    }

    /// The next order, if one comes before `due`.
    fn next_order(&self, due: Instant) -> Option<Order> {
        match self.orders.recv_timeout(due.saturating_duration_since(Instant::now())) {
            Ok(order) => Some(order),
            Err(RecvTimeoutError::Timeout) => None,
            Err(RecvTimeoutError::Disconnected) => {
                self.hub.end();
                None
            }
        }
    }

    fn refuse_orders(&self, until: Instant) {
        while let Some(order) = self.next_order(until) {
            let refused = Refused::new(Kind::Link, "the board is not connected; nothing was sent");
            // The page may have gone away.
            let _ = order.answer.send(Err(refused));
        }
    }

    fn execute(&mut self, client: &mut Client, order: Order) {
        let done = self.prepare(client, &order).and_then(|()| {
            let done = self.send(client, &order);
            match (&order.task, &done) {
                (Task::Play { .. }, Ok(())) => self.is_by_hand = false,
                // Also where the answer is lost.
                (Task::Command(_), Ok(())) => self.is_by_hand = true,
                (Task::Command(_), Err(refused)) => self.is_by_hand |= refused.kind != Kind::Refused,
                // Its answer is text: what it has done is not known.
                (Task::Type(_), _) => self.is_by_hand |= order.key.is_some(),
                _ => {}
            }
            done
        });
        // The page may have gone away.
        let _ = order.answer.send(done);
    }

    /// Refuses an order that is too old, that a stop has overtaken, or whose page has lost control. The number of stops is compared after the connection was
    /// opened: the board itself refuses a command after a stop that comes later.
    fn prepare(&mut self, client: &mut Client, order: &Order) -> Result<(), Refused> {
        self.open_again(client)?;
        order.ordered.check_stops(self.hub.stops().count())?;
        if order.ordered.made < self.opened {
            let text = "the connection was opened meanwhile, as after a stop; nothing was sent";
            return Err(Refused::new(Kind::Stopped, text));
        }
        if let Some(key) = order.key {
            self.hub.control(|control| control.check(key))?;
        }
        order.ordered.check_age()
    }

    /// Opens the connection where a stop of a page or the board has ended it, or joins the one that a program has opened since.
    fn open_again(&mut self, client: &mut Client) -> Result<(), ClientError> {
        let is_open = self.stops_at_hello == Some(self.hub.stops().count()) && client.knows_connection();
        if is_open { Ok(()) } else { self.say_hello(client) }
    }

    fn say_hello(&mut self, client: &mut Client) -> Result<(), ClientError> {
        let stops = self.hub.stops().count();
        client.join()?;
        (self.stops_at_hello, self.opened) = (Some(stops), Instant::now());
        Ok(())
    }

    fn send(&mut self, client: &mut Client, order: &Order) -> Result<(), Refused> {
        match &order.task {
            Task::Command(command) => client.command(*command).map_err(|error| self.refused(error)),
            Task::Play { table } => self.play(client, *table),
            Task::Upload(program) => self.upload(client, program),
            Task::Type(line) => {
                self.hub.typed(line);
                let ordered = order.ordered;
                let is_late = || ordered.check_stops(self.hub.stops().count()).and(ordered.check_age()).is_err();
                let typed = match order.key {
                    None => client.type_line(line),
                    Some(_) => client.type_change(line, is_late),
                };
                typed.map_err(|error| self.refused(error))
            }
        }
    }

    fn play(&mut self, client: &mut Client, table: Digest) -> Result<(), Refused> {
        // A program may have uploaded another one over this port.
        client.renew_hello().map_err(|error| self.refused(error))?;
        if client.hello().and_then(|hello| hello.table) != Some(table) {
            let text = "the board has another table than this page shows; upload it first";
            return Err(Refused::new(Kind::Refused, text));
        }
        client.command(Command::Play).map_err(|error| self.refused(error))
    }

    fn upload(&mut self, client: &mut Client, program: &Program) -> Result<(), Refused> {
        let file = program.file.as_ref().ok_or_else(|| {
            program.view.refusal.clone().unwrap_or_else(|| Refused::new(Kind::Refused, "the table breaks a limit"))
        })?;
        file.check_device(client.identity().device)?;
        if let Some(hello) = client.hello() {
            file.check_profile(hello.profile)?;
        }
        let (hub, connection) = (Arc::clone(&self.hub), client.connection());
        let uploaded = client.upload(&file.image, &mut |progress| {
            hub.set_upload(Some(UploadView { done: progress.done, total: progress.total }));
        });
        self.hub.set_upload(None);
        if client.connection() != connection {
            // It was opened again on the way.
            self.opened = Instant::now();
        }
        // The answer to hello names the table that the board has now.
        uploaded.and_then(|_| client.renew_hello()).map_err(|error| self.refused(error))?;
        self.keep_table(client, program, file);
        Ok(())
    }

    /// Keeps a table that the board has taken in the history; where that fails the upload has not failed.
    fn keep_table(&self, client: &Client, program: &Program, file: &TableFile) {
        let Some(history) = self.hub.history() else { return };
        let bytes = table_file::bytes(&file.image);
        let (digest, model) = (file.digest().to_string(), file.image.image().model.to_string());
        let (rows, end_s) = (program.view.rows.len(), program.view.end_s);
        let (board, device) = (client.identity().board.to_string(), client.identity().device.to_string());
        let entry = TableEntry {
            digest: &digest,
            name: &program.view.name,
            model: &model,
            rows,
            end_s,
            file: &bytes,
            board: &board,
            device: &device,
        };
        if let Err(error) = history.add_table(&entry, unix_time::now_ms()) {
            eprintln!("darm serve: the history does not keep the table: {error}");
        }
    }

    /// Opens the connection again before the next order where the board has ended it.
    fn refused(&mut self, error: ClientError) -> Refused {
        let refused = Refused::from(error);
        if refused.kind != Kind::Refused {
            self.stops_at_hello = None;
        }
        refused
    }
}
