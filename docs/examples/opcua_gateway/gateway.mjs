// From an OPC UA server to CSV lines on stdout, one a sample period, which
// `fdi-simulator replay --file -` publishes on DDS. See README.md.
//
// The server is subscribed to, so what happens between two publications waits in
// its queues. The row of instant t holds, for every tag, the newest reading with
// a stamp up to t, and is written once the server has spoken of a later time.
import {readFileSync} from 'node:fs';

console.log = console.error;  // The library talks there; stdout is the table.
const opcua = await import('node-opcua-client');

const config = JSON.parse(readFileSync(process.argv[2], 'utf8'));
const periodMs = 1000 * (config.period_s ?? 1);
const intervalMs = config.interval_ms ?? periodMs / 4;
const silenceMs = 10_000 + 3 * periodMs;  // then the connection is given up
const longestLeap = 3600;  // periods; beyond it no reading is held
const nodes = Object.values(config.tags);
if (config.mode) nodes.push(config.mode.node);
const wait = seconds => new Promise(resolve => { setTimeout(resolve, 1000 * seconds); });

const count = {rows: 0, lost: 0, bad: 0, uncertain: 0, overflows: 0, reconnects: 0};
const say = text => console.error(`opcua_gateway: ${text}`);
const sum = () => Object.entries(count).map(([what, n]) => `${n} ${what}`).join(', ');

let lastRow;   // the newest row that was written, in periods since 1970
let mode = 'AUTO';
let stop, why;
const stopped = new Promise(resolve => { stop = reason => resolve(why = reason); });
for (const signal of ['SIGTERM', 'SIGINT']) process.on(signal, () => stop('stopped'));
process.stdout.on('error', () => stop('nobody reads the rows'));

// A number, or a word that the reader takes for "no reading".
function cellOf(i, {statusCode, value}) {
  if (statusCode.hasOverflowBit) ++count.overflows;
  const usable = statusCode.isGoodish();
  if (i === Object.keys(config.tags).length)
    return mode = (usable && config.mode.words[String(value?.value)]) || mode;
  if (usable && Number.isFinite(value?.value)) return value.value;
  ++count[usable || statusCode.isBad() ? 'bad' : 'uncertain'];
  return 'Bad';
}

// What one connection says. After another one, all begins anew: nobody knows
// what happened in between.
class Rows {
  queues = nodes.map(() => []);
  cells = nodes.map(() => undefined);
  newest = -Infinity;  // stamp [ms]
  constructor(end) { this.end = end; }

  // One message of the server; without items it says that nothing changed.
  take(items) {
    // The readings of an instant may be in two messages: one is waited for.
    let known = this.newest;
    for (const {index, value} of items) {
      const source = config.stamps === 'server' ? null : value.sourceTimestamp;
      const stamp = Number(source ?? value.serverTimestamp ?? Date.now());
      this.queues[index].push({stamp, cell: cellOf(index, value)});
      this.newest = Math.max(this.newest, stamp);
      this.since = performance.now();
    }
    if (items.length === 0) known += performance.now() - this.since;
    this.write(Math.floor(known / periodMs));
  }

  write(until) {
    if (this.next === undefined) {
      if (this.queues.some(queue => queue.length === 0)) return;
      this.next = Math.ceil(Math.max(...this.queues.map(([first]) => first.stamp)) / periodMs);
      if (lastRow !== undefined) {
        this.next = Math.max(this.next, lastRow + 1);
        const lost = this.next - lastRow - 1;
        count.lost += lost, ++count.reconnects;
        say(`connected again after ${lost} lost rows; ${sum()}`);
      }
    }
    if (until - this.next > longestLeap) return this.end('the stamps leap');
    for (; this.next <= until; ++this.next) {
      this.queues.forEach((queue, i) => {
        while (queue.length > 0 && queue[0].stamp <= this.next * periodMs)
          this.cells[i] = queue.shift().cell;
      });
      const time = new Date(this.next * periodMs).toISOString();
      process.stdout.write([time, ...this.cells].join() + '\n');
      lastRow = this.next, ++count.rows;
    }
  }
}

// Writes rows until the connection ends. @returns whether there was any.
async function follow() {
  const client = opcua.OPCUAClient.create({
    applicationName: 'fdi gateway', endpointMustExist: false,
    connectionStrategy: {maxRetry: 0},
    securityMode: opcua.MessageSecurityMode[config.security ? 'SignAndEncrypt' : 'None'],
    securityPolicy: opcua.SecurityPolicy[config.security ?? 'None'],
  });
  let end;
  const ended = new Promise(resolve => { end = resolve; });
  for (const event of ['connection_lost', 'close', 'abort'])
    client.on(event, () => end('the connection is lost'));
  let watchdog;
  const heard = () => {
    clearTimeout(watchdog);
    watchdog = setTimeout(end, silenceMs, 'the server is silent');
  };
  const rows = new Rows(end);
  heard();
  const read = async () => {
    await client.connect(config.endpoint);
    const session = await client.createSession(config.user && {
      type: opcua.UserTokenType.UserName, userName: config.user,
      password: process.env.OPCUA_PASSWORD});
    const subscription = await session.createSubscription2({
      requestedPublishingInterval: intervalMs, requestedMaxKeepAliveCount: 5,
      requestedLifetimeCount: 100, publishingEnabled: false});
    subscription.on('terminated', () => end('the subscription has ended'));
    const group = await subscription.monitorItems(
      nodes.map(nodeId => ({nodeId, attributeId: opcua.AttributeIds.Value})),
      {samplingInterval: intervalMs, queueSize: 1000, discardOldest: true},
      opcua.TimestampsToReturn.Both);
    const handles = new Map(group.monitoredItems.map((item, index) => {
      if (!item.statusCode.isGoodish())
        throw Error(`node ${nodes[index]}: ${item.statusCode.name}`);
      return [item.monitoringParameters.clientHandle, index];
    }));
    subscription.on('raw_notification', ({notificationData}) => {
      heard();
      const items = (notificationData ?? []).flatMap(data => data.monitoredItems ?? []);
      rows.take(items.map(({clientHandle, value}) =>
        ({index: handles.get(clientHandle), value})));
    });
    await subscription.setPublishingMode(true);
  };
  const reason = await Promise.race([ended, stopped,
    read().then(() => ended, error => error.message.split('\n')[0])]);
  clearTimeout(watchdog);
  await Promise.race([client.disconnect().catch(() => {}), wait(2)]);
  say(reason);
  return rows.next !== undefined;
}

const names = ['time', ...Object.keys(config.tags), ...(config.mode ? ['mode'] : [])];
process.stdout.write(names.join() + '\n');
for (let pauseS = 1; !why; pauseS = Math.min(60, 2 * pauseS)) {
  if (await follow()) pauseS = 1;
  await Promise.race([stopped, wait(pauseS)]);
}
say(sum());
process.exit(why === 'stopped' ? 0 : 1);
