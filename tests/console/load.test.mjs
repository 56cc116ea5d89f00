// Five hundred valves at 1 Hz: how much work the main thread has for a frame.
// Measured by Chromium's tracing: the run time of all tasks of the renderer's
// main thread in each sixtieth of a second in which there was work at all.

import assert from 'node:assert/strict';
import {after, before, test} from 'node:test';

import {launch, open} from './browser.mjs';
import {Plant, until} from './programs.mjs';

const kValves = 500;
const kMeasuredMs = 8000;
const kMedianLimitMs = 8;
const kFrameUs = 1e6 / 60;
const kIdleMs = 0.1;

const plant = new Plant();
let browser;
let address;

before(async () => {
  [browser] = await Promise.all([launch(), plant.train()]);
  ({address} = await plant.startMonitor());
  plant.simulate('--valve', 'FV', '--count', String(kValves), '--duration',
      '3600', '--speed', '1');
});

after(async () => {
  await browser?.close();
  await plant.stop();
});

/** Milliseconds of work in each frame that had any, ascending. */
function workOfFrames({traceEvents: events}) {
  const {pid, tid} = events.find((event) => event.name === 'thread_name' &&
      event.args.name === 'CrRendererMain');
  const frames = new Map();
  for (const event of events) {
    if (event.name !== 'RunTask' || event.ph !== 'X' || event.pid !== pid ||
        event.tid !== tid) continue;
    const frame = Math.floor(event.ts / kFrameUs);
    frames.set(frame, (frames.get(frame) ?? 0) + event.dur / 1000);
  }
  return [...frames.values()].filter((ms) => ms > kIdleMs)
      .sort((one, other) => one - other);
}

test('500 valves leave the main thread at rest', async () => {
  const page = await open(browser, address, '#/');
  await page.locator('.chip', {hasText: `All ${kValves}`}).waitFor();
  await browser.startTracing(page, {categories: [
    'devtools.timeline', 'disabled-by-default-devtools.timeline']});
  const stamps = () => page.evaluate(() => performance.now());
  const begin = await stamps();
  await until(async () => await stamps() - begin > kMeasuredMs, 'the trace');
  const trace = JSON.parse((await browser.stopTracing()).toString());

  const work = workOfFrames(trace);
  const at = (share) => work[Math.floor(share * (work.length - 1))];
  console.log(`${work.length} frames; work of the main thread: median ` +
    `${at(0.5).toFixed(2)} ms, 95 % ${at(0.95).toFixed(2)} ms, most ` +
    `${at(1).toFixed(2)} ms`);
  assert.ok(work.length > 10, `${work.length} frames`);
  assert.ok(at(0.5) <= kMedianLimitMs, `${at(0.5)} ms`);
  assert.deepEqual(page.faults, []);
});
