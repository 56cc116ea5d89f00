// The page over https, with users: who sees and does what.

import assert from 'node:assert/strict';
import path from 'node:path';
import {after, before, test} from 'node:test';

import {accessibilityFaults, launch, open} from './browser.mjs';
import {Plant} from './programs.mjs';

const kPassword = 'correct horse';
const kOptions = {ignoreHTTPSErrors: true};  // Nobody vouches for our key.

const plant = new Plant();
const users = path.join(plant.data, 'users');
let browser;
let monitor;
let address;

before(async () => {
  const keys = path.join(plant.data, 'keys');
  await plant.run('fdi-store', 'keys', 'init', keys);
  await plant.run('fdi-store', 'keys', 'add', keys, 'page', '--role', 'reader');
  for (const role of ['view', 'acknowledge', 'engineer']) {
    plant.addUser(users, role, kPassword);
  }
  plant.access = ['--console-tls', path.join(keys, 'page', 'cert.pem'),
    '--console-key', path.join(keys, 'page', 'key.pem'),
    '--console-users', users];
  [browser] = await Promise.all([launch(), plant.train()]);
  ({monitor, address} = await plant.startMonitor());
  plant.simulate('--valve', 'V1', '--duration', '3000', '--speed', '10',
      '--fault', 'f19:abrupt@120:strength=0.5');
});

after(async () => {
  await browser?.close();
  await plant.stop();
});

async function logIn(page, user, password = kPassword) {
  await page.getByLabel('Name').fill(user);
  await page.getByLabel('Password').fill(password);
  await page.getByRole('button', {name: 'Log in'}).click();
}

test('nothing is shown before a login', async () => {
  const page = await open(browser, address, '#/alarms', kOptions);
  await logIn(page, 'engineer', 'not this one');
  await page.getByRole('alert', {name: ''}).filter({hasText: 'wrong'})
      .waitFor();
  assert.equal(await page.locator('nav').count(), 0);
  assert.deepEqual(await accessibilityFaults(page), []);

  await logIn(page, 'engineer');
  await page.locator('.user', {hasText: 'engineer, engineer'}).waitFor();
  await page.getByRole('button', {name: 'Label V1'}).waitFor();
  assert.deepEqual(page.faults, []);
  await page.context().close();
});

test('who may acknowledge does so by name, and cannot label', async () => {
  await plant.untilNamed('V1');
  const page = await open(browser, address, '#/alarms', kOptions);
  await logIn(page, 'acknowledge');
  await page.getByRole('button', {name: 'Acknowledge V1'}).click();
  await page.getByRole('dialog').getByRole('button', {name: 'Acknowledge'})
      .click();
  await page.locator('tr.group-ACKED', {hasText: 'acknowledge'}).waitFor();
  assert.equal(await page.getByRole('button', {name: 'Label V1'}).count(), 0);
  assert.match(monitor.errors,
      /console_action user="acknowledge" .*action=ack valve="V1" episode=/);

  await page.getByRole('button', {name: 'Log out'}).click();
  await page.getByLabel('Password').waitFor();
  await page.reload();
  await page.getByLabel('Password').waitFor();
  await page.context().close();
});

test('who may view has no buttons, and is asked again when removed',
    async () => {
      const page = await open(browser, address, '#/alarms', kOptions);
      await logIn(page, 'view');
      await page.getByText('Read-only: your role is view.').waitFor();
      await page.locator('tr[data-episode]').first().waitFor();
      assert.equal(
          await page.getByRole('button', {name: 'Acknowledge V1'}).count(), 0);

      plant.addUser(users, 'view', 'another password');
      monitor.kill('SIGHUP');
      await page.getByLabel('Password').waitFor();
      await page.context().close();
    });
