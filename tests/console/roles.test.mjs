// The page through nginx: who sees and does what.

import assert from 'node:assert/strict';
import {after, before, test} from 'node:test';

import {launch, open, userOptions} from './browser.mjs';
import {Plant} from './programs.mjs';

const plant = new Plant();
let browser;
let monitor;
let address;

before(async () => {
  [browser] = await Promise.all([launch(), plant.train()]);
  ({monitor, address} = await plant.startMonitor());
  plant.simulate('--valve', 'V1', '--duration', '3000', '--speed', '10',
      '--fault', 'f19:abrupt@120:strength=0.5');
});

after(async () => {
  await browser?.close();
  await plant.stop();
});

test('nothing is shown without the password, or without a role', async () => {
  for (const [user, password, status] of [
    ['engineer', 'not this one', 401], ['nobody', 'correct horse', 401],
    ['stranger', 'correct horse', 403]]) {
    const context = await browser.newContext(userOptions(user, password));
    const answer = await context.request.get(`${address}/api/v1/status`);
    assert.equal(answer.status(), status, user);
    await context.close();
  }
});

test('who may acknowledge does so by name, and cannot label', async () => {
  await plant.untilNamed('V1');
  const page = await open(browser, address, '#/alarms',
      userOptions('acknowledge'));
  await page.locator('.user', {hasText: 'acknowledge, acknowledge'}).waitFor();
  await page.getByRole('button', {name: 'Acknowledge V1'}).click();
  await page.getByRole('dialog').getByRole('button', {name: 'Acknowledge'})
      .click();
  await page.locator('tr.group-ACKED', {hasText: 'acknowledge'}).waitFor();
  assert.equal(await page.getByRole('button', {name: 'Label V1'}).count(), 0);
  assert.match(monitor.errors,
      /console_action user="acknowledge" .*action=ack valve="V1" episode=/);
  assert.deepEqual(page.faults, []);
  await page.context().close();
});

test('an engineer may label', async () => {
  const page = await open(browser, address, '#/alarms');
  await page.getByRole('button', {name: 'Label V1'}).waitFor();
  await page.context().close();
});

test('who may view has no buttons', async () => {
  const page = await open(browser, address, '#/alarms', userOptions('view'));
  await page.getByText('Read-only: your role is view.').waitFor();
  await page.locator('tr[data-episode]').first().waitFor();
  assert.equal(
      await page.getByRole('button', {name: 'Acknowledge V1'}).count(), 0);
  await page.context().close();
});
