// An OPC UA server of what the monitors find: Valves/GROUP/VALVE with its health
// after NE 107, and alarms that clients acknowledge. docs/connect.md.
//
//     node server.mjs [--port 4840] [-- --plant plant.toml]
//
// Behind "--" are options of `fdi-gateway out`, which tells it of the valves. On
// loopback anybody may read. Beyond it a client needs a certificate that was
// trusted, encryption and a user of --users.
import {hostname} from 'node:os';
import {parseArgs} from 'node:util';

console.log = console.error;  // The library talks there.
const {default: opcua} = await import('node-opcua-client');
const {OPCUAServer} = await import('node-opcua-server');
const {OPCUACertificateManager} = await import('node-opcua-certificate-manager');
const {nodesets} = await import('node-opcua-nodesets');
const {followStates} = await import('./programs.mjs');
const {Users} = await import('./users.mjs');
const {Valves} = await import('./valves.mjs');

const uri = `urn:${hostname()}:fdi`;  // Names this server; the valves have the same URI everywhere.
const {MessageSecurityMode, SecurityPolicy} = opcua;
const say = text => console.error(`opcua_server: ${text}`);
const clientsAtOnce = 100;

let options, positionals;
try {
  ({values: options, positionals} = parseArgs({allowPositionals: true, options: {
    port: {type: 'string', default: '4840'},
    host: {type: 'string', default: '127.0.0.1'},
    users: {type: 'string'},
    pki: {type: 'string', default: `${process.env.FDI_DATA ?? 'fdi-data'}/opcua`},
  }}));
} catch (error) {
  say(`${error.message}\nusage: server.mjs [--port 4840] [--host 127.0.0.1] [--users FILE] ` +
    '[--pki FOLDER] [-- OPTIONS of fdi-gateway out]');
  process.exit(2);
}
const loopback = ['127.0.0.1', '::1', 'localhost'].includes(options.host);
if (!loopback && !options.users) {
  say(`--host ${options.host} is not loopback: it takes --users FILE`);
  process.exit(2);
}

async function open() {
  const users = new Users(options.users);
  const store = new OPCUACertificateManager({rootFolder: options.pki,
    automaticallyAcceptUnknownCertificate: false});
  await store.initialize();
  const server = new OPCUAServer({
    port: Number(options.port), host: options.host, hostname: loopback ? options.host : undefined,
    nodeset_filename: [nodesets.standard, nodesets.di],
    serverCertificateManager: store, userCertificateManager: store,
    securityModes: [...loopback ? [MessageSecurityMode.None] : [], MessageSecurityMode.SignAndEncrypt],
    securityPolicies: [...loopback ? [SecurityPolicy.None] : [], SecurityPolicy.Basic256Sha256,
      SecurityPolicy.Aes128_Sha256_RsaOaep, SecurityPolicy.Aes256_Sha256_RsaPss],
    allowAnonymous: loopback,
    userManager: {isValidUserAsync: (name, password, answer) =>
      users.check(name, password).then(right => {
        if (!right) say(`login refused user=${JSON.stringify(name)}`);
        answer(null, right);
      }, answer)},
    serverInfo: {applicationUri: uri, applicationName: {text: 'fdi valve diagnosis', locale: 'en'}},
    buildInfo: {productName: 'fdi', manufacturerName: 'fdi'},
    maxConnectionsPerEndpoint: clientsAtOnce,
    serverCapabilities: {maxSessions: clientsAtOnce},
  });
  await server.initialize();
  const operator = {
    nameOf: context => context.session?.userIdentityToken?.userName ?? '',
    may: name => users.mayAct(name),
    say,
  };
  return {server, valves: new Valves(server.engine.addressSpace, operator)};
}

let opened;
try {
  opened = await open();
  await opened.server.start();
} catch (error) {
  say(error.message.split('\n')[0]);
  process.exit(error.code === 'EADDRINUSE' ? 6 : 2);
}
const {server, valves} = opened;
const end = followStates(positionals, {
  onState: state => valves.show(state), onSilence: why => valves.silence(why), say});
say(`ready port=${options.port} host=${options.host}`);
for (const signal of ['SIGTERM', 'SIGINT'])
  process.on(signal, async () => {
    end();
    await Promise.race([server.shutdown(0), new Promise(resolve => setTimeout(resolve, 3000))]);
    process.exit(0);
  });
