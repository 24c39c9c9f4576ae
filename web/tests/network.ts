// A bad network between a browser and the server, and a wire whose bytes are seen.
import { createServer, connect, type AddressInfo, type Server, type Socket } from 'node:net';

/** What happens to the bytes of both directions. */
export interface Weather {
  /** Time until they arrive, ms. */
  delay: number;
  /** Each time of arrival is up to this much later, ms. Bytes stay in order. */
  jitter: number;
  /** Bytes wait until this many are there; 0: they do not. */
  hoard: number;
  /** Bytes a second; 0: no limit. */
  rate: number;
  /** Bytes arrive in pieces of at most so many; 0: as they were sent. */
  piece: number;
  /** Nothing arrives and nothing is closed: a cable is out, or a machine is gone. */
  cut: 'no' | 'both' | 'to-server' | 'to-browser';
}

export const FINE: Weather = { delay: 0, jitter: 0, hoard: 0, rate: 0, piece: 0, cut: 'no' };

/** One direction of a connection. */
class Pipe {
  private queue: { bytes: Buffer; at: number }[] = [];
  private hoarded: Buffer[] = [];
  private last = 0;
  private timer: NodeJS.Timeout | undefined;
  private isAbandoned = false;

  constructor(
    private to: Socket,
    private weather: () => Weather,
    private way: 'to-server' | 'to-browser',
  ) {}

  push(bytes: Buffer) {
    const { delay, jitter, hoard, rate, piece } = this.weather();
    this.hoarded.push(bytes);
    const size = this.hoarded.reduce((sum, part) => sum + part.length, 0);
    if (size < hoard) return;
    const whole = Buffer.concat(this.hoarded);
    this.hoarded = [];
    const arrival = performance.now() + delay + Math.random() * jitter;
    this.last = Math.max(arrival, this.last);
    for (let from = 0; from < whole.length; ) {
      const part = whole.subarray(from, piece ? from + piece : undefined);
      this.last += rate ? (1000 * part.length) / rate : 0;
      this.queue.push({ bytes: part, at: this.last });
      from += part.length;
    }
    this.pump();
  }

  /** What waits arrives now, as far as the weather lets it. */
  hurry() {
    this.last = 0;
    this.queue.forEach((one) => (one.at = 0));
    this.pump();
  }

  /** Nothing arrives any more, and nobody is told. */
  abandon() {
    this.isAbandoned = true;
  }

  /** Moves what has arrived. */
  pump = () => {
    clearTimeout(this.timer);
    const { cut } = this.weather();
    if (this.isAbandoned || cut === 'both' || cut === this.way) return;
    while (this.queue[0] && this.queue[0].at <= performance.now()) {
      this.to.write(this.queue.shift()!.bytes);
    }
    if (this.queue[0]) this.timer = setTimeout(this.pump, this.queue[0].at - performance.now());
  };

  end() {
    clearTimeout(this.timer);
  }
}

/** A proxy for HTTP and WebSocket that a browser uses: the addresses stay those of the server. */
export class Network {
  weather: Weather = FINE;
  private server: Server;
  private pipes = new Set<Pipe>();
  private sockets = new Set<Socket>();

  private constructor() {
    this.server = createServer((browser) => this.accept(browser));
  }

  static async open() {
    const network = new Network();
    await new Promise<void>((done) => network.server.listen(0, '127.0.0.1', done));
    return network;
  }

  /** For the option `proxy` of a browser. */
  get proxy() {
    const { port } = this.server.address() as AddressInfo;
    return { server: `http://127.0.0.1:${port}`, bypass: '<-loopback>' };
  }

  set(weather: Partial<Weather>) {
    this.weather = { ...FINE, ...weather };
    this.pipes.forEach((pipe) => pipe.hurry());
  }

  /** Closes all connections, as a proxy does that ends. */
  drop() {
    this.sockets.forEach((socket) => socket.destroy());
  }

  /** All connections die without a word, as with a router that was switched off. New ones work. */
  abandon() {
    this.pipes.forEach((pipe) => pipe.abandon());
  }

  async close() {
    this.drop();
    await new Promise((done) => this.server.close(done));
  }

  private accept(browser: Socket) {
    let head = '';
    const read = (bytes: Buffer) => {
      head += bytes.toString('latin1');
      if (!head.includes('\r\n\r\n')) return;
      browser.off('data', read);
      const [method, target = ''] = head.split(' ');
      const isTunnel = method === 'CONNECT';
      const { hostname, port, pathname, search } = new URL(isTunnel ? `http://${target}` : target);
      const server = connect(Number(port || 80), hostname);
      const up = this.pipe(browser, server, 'to-server');
      this.pipe(server, browser, 'to-browser');
      if (isTunnel) browser.write('HTTP/1.1 200 OK\r\n\r\n');
      else up.push(Buffer.from(head.replace(target, pathname + search), 'latin1'));
    };
    browser.on('data', read);
    browser.on('error', () => {});
  }

  private pipe(from: Socket, to: Socket, way: 'to-server' | 'to-browser') {
    const pipe = new Pipe(to, () => this.weather, way);
    this.pipes.add(pipe);
    this.sockets.add(from);
    from.setNoDelay();
    from.on('data', (bytes) => pipe.push(bytes));
    from.on('error', () => {});
    from.on('close', () => {
      pipe.end();
      this.pipes.delete(pipe);
      this.sockets.delete(from);
      to.destroy();
    });
    return pipe;
  }
}

/** A serial line over TCP between a program and simulated drives, whose bytes are seen. */
export class Wire {
  /** What the program sent, and when. */
  sent: { at: number; bytes: Buffer }[] = [];
  private server: Server;
  private sockets = new Set<Socket>();
  private isUnplugged = false;

  private constructor(drive: number) {
    this.server = createServer((program) => {
      if (this.isUnplugged) {
        program.destroy();
        return;
      }
      const drives = connect(drive, '127.0.0.1');
      for (const [from, to] of [[program, drives], [drives, program]] as const) {
        this.sockets.add(from);
        from.setNoDelay();
        from.on('data', (bytes) => {
          if (from === program) this.sent.push({ at: performance.now(), bytes });
          to.write(bytes);
        });
        from.on('error', () => {});
        from.on('close', () => {
          this.sockets.delete(from);
          to.destroy();
        });
      }
    });
  }

  static async open(drive: number) {
    const wire = new Wire(drive);
    await new Promise<void>((done) => wire.server.listen(0, '127.0.0.1', done));
    return wire;
  }

  get port() {
    return (this.server.address() as AddressInfo).port;
  }

  /** When bytes were sent that contain these, after a time. */
  when(wanted: Buffer, after: number) {
    return this.sent.find(({ at, bytes }) => at >= after && bytes.includes(wanted))?.at;
  }

  unplug() {
    this.isUnplugged = true;
    this.sockets.forEach((socket) => socket.destroy());
  }

  plug() {
    this.isUnplugged = false;
  }

  async close() {
    this.unplug();
    await new Promise((done) => this.server.close(done));
  }
}
