//! What the clients of both protocols do alike. The names are those of the module that uses a macro.

/// How clients open ports. `$open` opens a `$link` at a port.
macro_rules! opening {
    ($link:ty, $open:ident) => {
        /// Opens a port. No drive is asked anything.
        ///
        /// # Errors
        /// What keeps the port from being opened.
        pub fn open(port: &PortName, options: Options) -> Result<Self, Error> {
            Self::open_wrapped(port, |link| link, options)
        }

        /// As [`open`](Self::open), through what `wrap` puts around the port each time it is opened: a
        /// tap, or faults.
        pub fn open_wrapped(
            port: &PortName,
            mut wrap: impl FnMut(Box<$link>) -> Box<$link> + Send + 'static,
            options: Options,
        ) -> Result<Self, Error> {
            let options = options.on(port);
            let open = opener(port, &options, move |port| Ok(wrap(port.$open()?)));
            let opened = Reopening::open(&port.to_string(), open, options.back_off)?;
            Ok(Self::driving(Driven::new(opened, &options)))
        }

        /// As [`open`](Self::open), through a link of the caller's making.
        pub fn open_with(
            name: &str,
            mut open: Opener<Box<$link>>,
            options: Options,
        ) -> Result<Self, Error> {
            let open = Box::new(move || open().map(Way::Line));
            let opened = Reopening::open(name, open, options.back_off)?;
            Ok(Self::driving(Driven::new(opened, &options)))
        }
    };
}

/// What clients that wait do. Their links are `$link`s.
macro_rules! waiting {
    ($link:ty) => {
        /// Speaks through a link that is open already. It is not opened again when it closes.
        pub fn over(name: &str, link: Box<$link>, options: Options) -> Self {
            Self::driving(Driven::new(Reopening::over(name, Way::Line(link)), &options))
        }

        /// Calls `look` every [`LOOK`](crate::LOOK) while an exchange waits, in the thread that waits; an
        /// error from it ends the exchange with an interruption.
        ///
        /// `look` may use this client, as a signal's handler does. What waits is given up then and ends
        /// with [`PortError::Overtaken`]. If `look` does not use the client, it goes on. Other threads
        /// wait for their turn.
        pub fn with_interrupt_hook(
            mut self,
            look: impl Fn() -> Result<(), Box<dyn error::Error + Send + Sync>>
            + Send
            + Sync
            + 'static,
        ) -> Self {
            self.turns.set_look(Box::new(look));
            self
        }

        /// Gives up what this thread has under way while it [looks](Self::with_interrupt_hook); replies
        /// may still come. Waits for exchanges of other threads.
        pub fn abandon(&self) {
            self.turns.take().abandon();
        }

        /// The clock that the port goes by: the machine's, or that of drives on a time of their own.
        pub fn clock(&self) -> Clock {
            self.turns.take().port.clock()
        }

        /// Whether the port is open. Never waits, not even while another thread opens it.
        pub fn link_state(&self) -> LinkState {
            self.sign.state()
        }

        /// Declares what a program that holds the port, such as a share, does with the motors of this client
        /// when it leaves, also if it is killed. It holds for motors that are moved after this call. Other
        /// ports do nothing then.
        pub fn end_with(&self, ending: Ending) {
            self.turns.take().port.end_with(ending);
        }

        /// While `act` stops motors, those that another program has moved since are left as they are.
        pub(super) fn for_own<T>(&self, act: impl FnOnce() -> T) -> T {
            self.turns.take().port.only_own(true);
            let result = act();
            self.turns.take().port.only_own(false);
            result
        }
    };
}

/// What clients for event loops do.
macro_rules! evented {
    () => {
        /// Whether the port is open.
        pub fn link_state(&self) -> LinkState {
            self.driven.port.sign().state()
        }

        /// What is readable when there is something to receive; `None` while the port is closed, or
        /// where it has its answers at once.
        pub fn descriptor(&self) -> Option<BorrowedFd<'_>> {
            self.driven.port.open_link().and_then(Way::descriptor)
        }

        /// The clock of the port.
        pub fn clock(&self) -> Clock {
            self.driven.port.clock()
        }

        /// How long a reply may take.
        pub fn timeout(&self) -> Duration {
            self.driven.session.timeout
        }

        /// See [`Client::end_with`].
        pub fn end_with(&mut self, ending: Ending) {
            self.driven.port.end_with(ending);
        }

        /// The next request must not be sent later than this, if another program holds the port.
        pub fn expire_next(&mut self, time_to_live: Duration) {
            if let Some(held) = &mut self.driven.session.held {
                held.requests.expire_next(time_to_live);
            }
        }
    };
}

pub(crate) use {evented, opening, waiting};
