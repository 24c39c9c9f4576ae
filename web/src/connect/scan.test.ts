import { beforeEach, expect, test, vi } from 'vitest';
import type { Finding } from '../wire';
import { askPorts } from './ask';
import { scan, type Scanned } from './scan';

vi.mock('./ask', () => ({ askPorts: vi.fn() }));

const RATES = [115_200, 57_600, 9600];
/** What answers at each rate; otherwise nothing does. */
let answers: Record<number, Finding> = {};
let asked: (number | null)[] = [];
let rates = RATES;

beforeEach(() => {
  answers = {};
  asked = [];
  rates = RATES;
  vi.mocked(askPorts).mockImplementation((async ({ rate }: { rate: number | null }) => {
    asked.push(rate);
    const at = rate ?? RATES[0]!;
    const finding = answers[at] ?? 'silence';
    return { port: `port at ${at}`, rate: rates.length ? at : null, finding, text: `${finding}!`, rates } as Scanned;
  }) as never);
});

function begin(protocol: 'st' | 'rmd', { may = true, endAfter = Infinity } = {}) {
  const left: number[] = [];
  const steps = {
    found: (_: Scanned, rest: number) => void left.push(rest),
    mayDisturb: async () => may,
    isEnded: () => asked.length >= endAfter,
  };
  return { left, said: scan({ port: 'x', protocol, timeout: null }, steps) };
}

test('rates are tried until a drive answers', async () => {
  answers = { 57_600: 'drive' };
  const { left, said } = begin('st');
  expect(await said).toEqual({ tone: 'ok', text: 'Found: drive!. Open opens it as port at 57600.' });
  expect(asked).toEqual([null, 57_600]);
  expect(left).toEqual([2, 1]);
});

test('a drive at the own rate ends it at once, also on a bus', async () => {
  answers = { 115_200: 'drive' };
  expect((await begin('rmd', { may: false }).said).tone).toBe('ok');
  expect(asked).toEqual([null]);
});

test('other bit rates of a bus need a yes', async () => {
  const { text } = await begin('rmd', { may: false }).said;
  expect(text).toBe('No motor answered. Other bit rates were not tried.');
  expect(asked).toEqual([null]);
});

test('nothing at any rate is said, and whether there were bytes', async () => {
  expect((await begin('st').said).text).toMatch(/^No drive answered at any of 3 rates\. Has it power\?/);
  expect(asked).toEqual([null, 57_600, 9600]);
  answers = { 57_600: 'garbage' };
  expect((await begin('st').said).text).toMatch(/but bytes were received/);
});

test('a port without rates is asked once', async () => {
  rates = [];
  expect((await begin('rmd').said).text).toMatch(/^No drive answered\. /);
  expect(asked).toEqual([null]);
});

test('echoes and foreign motors are no drives', async () => {
  answers = { 115_200: 'echo' };
  expect((await begin('st').said).tone).toBe('bad');
  answers = { 57_600: 'foreign' };
  expect((await begin('rmd').said).text).toBe('Nothing that can be driven from here: foreign!.');
});

test('it ends when somebody ends it', async () => {
  const { said } = begin('st', { endAfter: 2 });
  expect((await said).text).toBe('The scan was ended after 2 of 3 rates.');
  expect(asked).toEqual([null, 57_600]);
});
