// The monitor as Foxglove's own packages see it: @foxglove/ws-protocol reads, @foxglove/rosmsg2-serialization
// decodes. No browser is needed.
import { parse } from '@foxglove/rosmsg';
import { MessageReader } from '@foxglove/rosmsg2-serialization';
import type { Channel, FoxgloveClient, ServerInfo, StatusMessage } from '@foxglove/ws-protocol';
import { createRequire } from 'node:module';
import WebSocket from 'ws';
import { expect, test } from './bench';

// Node finds no names in the modules of this package.
const protocol = createRequire(import.meta.url)('@foxglove/ws-protocol') as typeof import('@foxglove/ws-protocol');

/** A viewer made of Foxglove's packages. */
class Viewer {
  readonly channels = new Map<string, Channel>();
  readonly statuses: StatusMessage[] = [];
  readonly client: FoxgloveClient;
  readonly messages: { topic: string; time: bigint; value: Record<string, unknown> }[] = [];
  info: ServerInfo | undefined;
  error: unknown;
  private topics = new Map<number, { topic: string; reader: MessageReader }>();

  constructor(url: string) {
    // The package knows a part of the interface of a WebSocket.
    this.client = new protocol.FoxgloveClient({ ws: new WebSocket(url, ['foxglove.sdk.v1']) as never });
    this.client.on('serverInfo', (info) => (this.info = info));
    this.client.on('error', (error) => (this.error = error));
    this.client.on('status', (status) => this.statuses.push(status));
    this.client.on('advertise', (channels) => channels.forEach((one) => this.channels.set(one.topic, one)));
    this.client.on('message', ({ subscriptionId, timestamp, data }) => {
      const { topic, reader } = this.topics.get(subscriptionId)!;
      this.messages.push({ topic, time: timestamp, value: reader.readMessage(data) });
    });
  }

  async subscribe(topic: string) {
    await expect.poll(() => this.channels.has(topic), { message: `${topic}: ${String(this.error)}` }).toBe(true);
    const channel = this.channels.get(topic)!;
    expect([channel.encoding, channel.schemaEncoding]).toEqual(['cdr', 'ros2msg']);
    const reader = new MessageReader(parse(channel.schema, { ros2: true }));
    this.topics.set(this.client.subscribe(channel.id), { topic, reader });
  }

  of(topic: string) {
    return this.messages.filter((message) => message.topic === topic);
  }

  last(topic: string) {
    return this.of(topic).at(-1)?.value;
  }
}

test("Foxglove's packages see what the motors do, and what their client may publish, set or call is refused", async ({ bench }) => {
  const viewer = new Viewer(String(bench.ready['foxglove_url']));
  const signals = '/st0/motor1/signals';
  for (const topic of [signals, '/joint_states', '/diagnostics', '/events', '/rmd0/motor2/signals_2_hz']) {
    await viewer.subscribe(topic);
  }
  expect(viewer.info!.capabilities).toEqual([]);
  bench.start();
  await expect.poll(() => viewer.last(signals)?.['speed_meas'] as number).toBeGreaterThan(900);
  const truth = await bench.speed('st', 1);
  const seen = viewer.of(signals).length;
  await expect.poll(() => viewer.of(signals).length).toBeGreaterThan(seen + 5);
  // The drive measures in steps of 6 rpm.
  expect(Math.abs((viewer.last(signals)!['speed_meas'] as number) - truth)).toBeLessThan(60);
  const { sec, nanosec } = viewer.last(signals)!['stamp'] as { sec: number; nanosec: number };
  expect(BigInt(sec) * 1_000_000_000n + BigInt(nanosec)).toBe(viewer.of(signals).at(-1)!.time);
  const joint = () => viewer.of('/joint_states').findLast((one) => (one.value['name'] as string[])[0] === 'st0_motor1');
  expect((joint()!.value['velocity'] as Float64Array)[0]).toBeGreaterThan(90);
  await expect.poll(() => viewer.last('/rmd0/motor2/signals_2_hz')?.['voltage_volts'] as number).toBeGreaterThan(5);
  await expect.poll(() => viewer.of('/events').some((one) => one.value['function'] === 'commanded')).toBe(true);
  const names = () => new Set(viewer.of('/diagnostics').flatMap((one) => (one.value['status'] as { name: string }[]).map((it) => it.name)));
  await expect.poll(() => names().has('rmd0/motor4')).toBe(true);
  expect([viewer.error, viewer.statuses]).toEqual([undefined, []]);

  const channel = viewer.client.advertise({ topic: '/cmd', encoding: 'json', schemaName: 'x' });
  viewer.client.sendMessage(channel, new Uint8Array([1, 2, 3]));
  viewer.client.setParameters([{ name: '/st0/motor1/SPEED_REF', value: 5 }], '1');
  viewer.client.getParameters([], '2');
  viewer.client.sendServiceCallRequest({ serviceId: 1, callId: 1, encoding: 'cdr', data: new DataView(new ArrayBuffer(4)) });
  viewer.client.fetchAsset('file:///etc/passwd', 1);
  await expect.poll(() => viewer.statuses.length).toBe(6);
  for (const status of viewer.statuses) {
    expect(status.level).toBe(2);
    expect(status.message).toMatch(/^this server is for reading alone/);
  }
  viewer.client.close();
});
