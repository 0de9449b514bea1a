// node peers.mjs MODULES OPERATION IN OUT: rewrites a glTF file with another tool, installed in the folder MODULES, that
// leaves what the file shows alone.
import { execFileSync } from 'node:child_process';
import { createRequire } from 'node:module';
import path from 'node:path';
import { pathToFileURL } from 'node:url';

const [modules, operation, input, output] = process.argv.slice(2);
const { resolve } = createRequire(path.resolve(modules, 'package.json'));
const load = (name) => import(pathToFileURL(resolve(name)));

const GLTFPACK = { gltfpack: [], 'gltfpack-noq': ['-noq', '-km'] };

async function transform() {
  const { Logger, NodeIO } = await load('@gltf-transform/core');
  const { ALL_EXTENSIONS } = await load('@gltf-transform/extensions');
  const { dedup, flatten, join, quantize } = await load('@gltf-transform/functions');
  const io = new NodeIO().registerExtensions(ALL_EXTENSIONS);
  const document = await io.read(input);
  document.setLogger(new Logger(Logger.Verbosity.ERROR));
  await document.transform({ dedup, flatten, join, quantize }[operation]());
  await io.write(output, document);
}

if (operation in GLTFPACK) {
  const cli = path.join(path.dirname(resolve('gltfpack')), 'cli.js');
  execFileSync(process.execPath, [cli, '-i', input, '-o', output, ...GLTFPACK[operation]]);
} else {
  await transform();
}
