// The page against a real monitor and a real simulator over DDS: alarms,
// actions, trends, a monitor that is killed, other hosts, accessibility.

import assert from 'node:assert/strict';
import {writeFileSync} from 'node:fs';
import path from 'node:path';
import {after, before, test} from 'node:test';

import {accessibilityFaults, inkShare, launch, open, setScheme} from './browser.mjs';
import {Plant, until} from './programs.mjs';

const kViews = ['#/', '#/alarms', '#/valve/V1', '#/history', '#/episode/last'];

const plant = new Plant();
let browser;
let monitor;
let address;

before(async () => {
  [browser] = await Promise.all([launch(), plant.train()]);
  ({monitor, address} = await plant.startMonitor());
});

after(async () => {
  await browser?.close();
  await plant.stop();
});

/** When a row of that valve was in the alarm list, and of which episode. */
function watchForAlarm(page, valve) {
  return page.evaluate((id) => new Promise((resolve, reject) => {
    setTimeout(() => reject(new Error('no alarm')), 30000);
    const look = () => {
      const row = [...document.querySelectorAll('tr[data-episode]')]
          .find((node) => node.textContent.includes(id));
      if (!row) return false;
      resolve({seenMs: Date.now(), episode: row.dataset.episode});
      return true;
    };
    if (look()) return;
    const observer =
      new MutationObserver(() => look() && observer.disconnect());
    observer.observe(document.body, {childList: true, subtree: true});
  }), valve);
}

test('the page loads and shows what is on the bus', async () => {
  const page = await open(browser, address, '#/');
  plant.simulate('--valve', 'V1', '--duration', '3000', '--speed', '10',
      '--fault', 'f19:abrupt@120:strength=0.5');
  plant.simulate('--valve', 'CALM', '--duration', '3000', '--speed', '10',
      '--seed', '2');

  await page.locator('.tile', {hasText: 'CALM'}).waitFor();
  await page.locator('.tile', {hasText: 'V1'}).waitFor();

  assert.deepEqual(page.faults, []);
  await page.context().close();
});

test('a fault is in the alarm list within 2 s of its event', async () => {
  const page = await open(browser, address, '#/alarms');

  const {seenMs, episode} = await watchForAlarm(page, 'V1');

  const answer = await page.request.get(
      `${address}/api/v1/episodes/${episode}`);
  const {events} = await answer.json();
  const detected = events.find((event) => event.kind === 'DETECTED');
  const delay = seenMs - detected.recorded_ms;
  console.log(`in the list after ${delay} ms`);
  assert.ok(delay < 2000, `${delay} ms`);
  await page.context().close();
});

test('acknowledging bears the name of the user and persists', async () => {
  await plant.untilNamed('V1');
  const page = await open(browser, address, '#/alarms');
  await page.getByRole('button', {name: 'Acknowledge V1'}).click();
  await page.getByLabel('Comment').fill('sent somebody');
  await page.getByRole('dialog').getByRole('button', {name: 'Acknowledge'})
      .click();
  await page.locator('tr.group-ACKED', {hasText: 'engineer'}).waitFor();

  const {episodes} = JSON.parse(await plant.run('fdi-store', 'history', 'list',
      '--valve', 'V1', '--json'));
  assert.equal(episodes[0].acked_by, 'engineer');

  await page.getByRole('button', {name: 'Label V1'}).click();
  await page.getByRole('dialog').getByRole('button', {name: 'Label'}).click();
  await page.getByRole('dialog').waitFor({state: 'detached'});
  await page.context().close();
});

test('shelving needs a reason and is shown', async () => {
  const page = await open(browser, address, '#/alarms');
  await page.getByRole('button', {name: 'Shelve V1'}).click();
  const shelve = page.getByRole('dialog').getByRole('button', {name: 'Shelve'});
  await shelve.click();
  assert.equal(await page.locator('tr.group-SHELVED').count(), 0);
  await page.getByLabel('Reason').fill('none');
  await shelve.click();
  await page.locator('tr.group-SHELVED', {hasText: 'V1'}).waitFor();
  await page.context().close();
});

test('the trend is drawn, zooms by keys and is saved', async () => {
  const page = await open(browser, address, '#/valve/V1');
  await page.locator('.panel').nth(2).waitFor();
  await until(async () => await inkShare(page, '.panel .u-over') > 0.003,
      'lines in the first panel');

  const ink = await inkShare(page, '.panels');
  assert.ok(ink > 0.01 && ink < 0.5, `ink ${ink}`);
  assert.match(await page.locator('.words').textContent(), /flow|F/i);

  await page.locator('.panels').focus();
  await page.keyboard.press('+');
  await page.locator('.paused').waitFor();
  await page.keyboard.press('End');
  await page.locator('.paused').waitFor({state: 'detached'});

  const [picture] = await Promise.all([page.waitForEvent('download'),
    page.getByRole('button', {name: 'Save as PNG'}).click()]);
  assert.equal(picture.suggestedFilename(), 'V1.png');
  assert.deepEqual(page.faults, []);
  await page.context().close();
});

test('a killed monitor costs a gap, which is shown', async () => {
  const page = await open(browser, address, '#/valve/CALM');
  const summary = page.locator('.trend-summary');
  const instants = async () =>
    Number(/^(\d+) instants/.exec(await summary.textContent())?.[1] ?? 0);
  const begin = async () =>
    / from (\S+ ?\S*) to /.exec(await summary.textContent())[1];
  await until(async () => await instants() > 100, 'a trend');
  const firstBefore = await begin();
  const countBefore = await instants();

  monitor.kill('SIGKILL');
  await monitor.ended;
  await page.locator('#banner', {hasText: 'Data stale since'}).waitFor();
  ({monitor} = await plant.startMonitor());
  await page.locator('#banner').waitFor({state: 'hidden'});
  await until(async () => await instants() > countBefore, 'new instants');

  assert.match(await summary.textContent(), /[1-9]\d* gaps?: /);
  assert.equal(await begin(), firstBefore);
  assert.match(await page.locator('.note[role=status]').textContent(), /started again/);
  assert.deepEqual(page.faults, []);
  await page.context().close();
});

test('what was done to alarms is there after the restart', async () => {
  const page = await open(browser, address, '#/alarms');
  await page.locator('tr', {hasText: 'engineer'}).or(
      page.locator('tr.group-SHELVED', {hasText: 'V1'})).first().waitFor();
  await page.context().close();
});

test('valves that ought to be there are listed, silent or not', async () => {
  const page = await open(browser, address, '#/');
  const once = page.locator('.tile', {hasText: 'ONCE'});
  // Its publisher dies, so that the stream does not end: it falls silent.
  const publisher = plant.simulate('--valve', 'ONCE', '--duration', '3000',
      '--speed', '20');
  await once.waitFor();
  publisher.kill('SIGKILL');
  await plant.run('fdi-store', 'valves', 'assign', 'GIVEN', 'quick');
  writeFileSync(path.join(plant.data, 'plant.csv'),
      'name,service,op,pv\nTABLED,F,CV_pct,F_t_h\n');
  await plant.run('fdi-store', 'valves', 'add', '--plant',
      path.join(plant.data, 'plant.csv'));

  monitor.kill('SIGTERM');
  await monitor.ended;
  ({monitor} = await plant.startMonitor());
  await page.reload();

  await once.filter({hasText: /no data since \d/}).waitFor();
  for (const id of ['GIVEN', 'TABLED']) {
    await page.locator('.tile', {hasText: id}).filter({hasText: 'no data'})
        .waitFor();
  }
  await page.context().close();
});

test('every view passes axe, light and dark, and asks no other host',
    async () => {
      const page = await open(browser, address, '#/');
      for (const hash of kViews) {
        await page.evaluate((to) => location.hash === to ||
            new Promise((shown) => {
              addEventListener('hashchange', shown, {once: true});
              location.hash = to;
            }), hash);
        await page.locator('main :is(.tile, tbody tr[role], .panel)').first()
            .waitFor();
        for (const colorScheme of ['light', 'dark']) {
          await setScheme(page, colorScheme);
          const faults = await accessibilityFaults(page,
              colorScheme === 'dark');
          assert.deepEqual(faults, [], `${hash} ${colorScheme}`);
        }
      }
      assert.deepEqual([...page.hosts], [address]);
      assert.deepEqual(page.faults, []);
      await page.context().close();
    });

test('links that nobody made show a view all the same', async () => {
  for (const hash of ['#/valve/%E0%A4%A', '#/__proto__', '#/constructor']) {
    const page = await open(browser, address, hash);
    await page.locator('main h1').waitFor();
    assert.deepEqual(page.faults, [], hash);
    await page.context().close();
  }
});

test('tile and alarm list give an alarm one priority', async () => {
  const page = await open(browser, address, '#/alarms');
  await page.locator('tr[data-episode]').first().waitFor();

  const pairs = await page.evaluate(async () => {
    const {priorityOf} = await import('/js/faults.js');
    const {store} = await import('/js/store.js');
    return [...store.alarms.values()]
        .filter((row) => store.tiles.get(row.valve)?.episode === row.episode)
        .map((row) => [priorityOf(row), priorityOf(store.tiles.get(row.valve)),
          row.strength, store.tiles.get(row.valve).strength]);
  });

  assert.ok(pairs.length > 0);
  for (const [listed, shown, strength, tileStrength] of pairs) {
    assert.equal(listed, shown);
    assert.equal(strength, tileStrength);
  }
  await page.context().close();
});

test('by keys alone: to the list, to an alarm, to its dialog', async () => {
  const page = await open(browser, address, '#/');
  await page.keyboard.press('2');
  await page.locator('h1', {hasText: 'Alarms'}).waitFor();
  await page.locator('tr[data-episode]').first().waitFor();
  await page.keyboard.press('j');
  await page.keyboard.press('l');
  await page.getByRole('dialog').waitFor();
  await page.keyboard.press('Escape');
  await page.getByRole('dialog').waitFor({state: 'detached'});
  await page.context().close();
});
