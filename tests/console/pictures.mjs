// Makes the pictures of the documents anew: a quarter of an hour of a plant of 22
// valves, of which some fail, at ten times the pace; its monitor; its page.
// Usage: run.sh PROGRAMS NODE_MODULES --pictures FOLDER

import {writeFileSync} from 'node:fs';
import path from 'node:path';
import {fileURLToPath} from 'node:url';

import {launch, open} from './browser.mjs';
import {Plant, until} from './programs.mjs';

const [folder] = process.argv.slice(2);
const kCampaign = fileURLToPath(
    new URL('../../campaigns/paper.toml', import.meta.url));
const kSeconds = 900;
const kSpeed = 10;
const kPictures = [
  {name: 'valve', hash: '#/valve/U2-PV-301', seen: '.panel', to: '.panels'},
  {name: 'plant', hash: '#/', seen: '.tile'},
  {name: 'alarms', hash: '#/alarms', seen: 'tr[data-episode]'},
];
const kGroups = `
[[group]]
name = "feed water"
valves = ["U1-FV-*"]
[[group]]
name = "boiler house"
valves = ["U2-*"]
`;

const plant = new Plant();
const browser = await launch();
try {
  plant.modelSet = 'paper';
  await plant.train(kCampaign, 600000);
  writeFileSync(path.join(plant.data, 'groups.toml'), kGroups);
  const {address} = await plant.startMonitor();
  const endMs = Date.now() + 1000 * kSeconds / kSpeed;
  let seed = 0;
  const simulate = (id, ...words) => plant.simulate('--valve', id,
      '--duration', String(kSeconds), '--speed', String(kSpeed),
      '--seed', String(seed += 20), ...words);
  simulate('U2-PV-301', '--fault', 'f19:abrupt@400:strength=0.5');
  simulate('U1-LV-204', '--fault', 'f6:abrupt@250:strength=0.6');
  simulate('U2-FV-108', '--fault', 'f3:abrupt@100:strength=0.5');
  simulate('U1-FV', '--count', '9');
  simulate('U2-FV', '--count', '8');
  simulate('U3-TV-11');
  const silent = simulate('U3-TV-12');

  const listed = async () => JSON.parse(await plant.run('fdi-store', 'history',
      'list', '--json')).episodes.filter((row) => row.fault);
  await until(async () => (await listed()).length >= 3, 'three names', 120000);
  await plant.run('fdi-store', 'history', 'ack', '--valve',
      'U2-FV-108', '--by', 'anna', '--comment', 'at the next stop');
  silent.kill('SIGKILL');
  // The data of all others still come, and are as new as can be.
  await new Promise((go) => setTimeout(go, endMs - 20000 - Date.now()));

  const page = await open(browser, address, '#/', {
    viewport: {width: 1280, height: 600}, reducedMotion: 'reduce',
    timezoneId: 'Europe/Berlin', locale: 'en-GB'});
  for (const {name, hash, seen, to} of kPictures) {
    await page.goto(`${address}/${hash}`);
    await page.locator(seen).nth(2).waitFor();
    await page.waitForTimeout(1000);  // All that follows the first paint.
    const end = to && await page.locator(to).boundingBox();
    await page.screenshot({path: path.join(folder, `${name}.png`),
      ...(end && {fullPage: true, clip: {x: 0, y: 0, width: 1280,
        height: end.y + end.height + 8}})});
  }
} finally {
  await browser.close();
  await plant.stop();
}
