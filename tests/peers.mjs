// node peers.mjs MODULES OPERATION IN OUT: rewrites a glTF file with another tool, installed in the folder MODULES, that
// leaves what the file shows alone.
import { execFileSync } from 'node:child_process';
import { createRequire } from 'node:module';
import path from 'node:path';
import { pathToFileURL } from 'node:url';

const [modules, operation, input, output] = process.argv.slice(2);
const { resolve } = createRequire(path.resolve(modules, 'package.json'));
const load = (name) => import(pathToFileURL(resolve(name)));

// What Blender 4 does when it imports and exports a file: names get numbers, transforms become translation, rotation and
// scale in single precision, and vertices come in another order.
function throughBlender(document) {
  const root = document.getRoot();
  for (const named of [...root.listMaterials(), ...root.listMeshes()]) named.setName(`${named.getName()}.001`);
  for (const node of root.listNodes()) {
    node.setTranslation(node.getTranslation().map(Math.fround));
    node.setRotation(node.getRotation().map(Math.fround));
    node.setScale(node.getScale().map(Math.fround));
  }
  for (const primitive of root.listMeshes().flatMap((mesh) => mesh.listPrimitives())) {
    if (primitive.getMode() !== 4) continue;
    const count = primitive.getAttribute('POSITION').getCount();
    const backwards = (owner) => {
      for (const semantic of owner.listSemantics()) {
        const given = owner.getAttribute(semantic);
        const turned = given.clone();
        const size = given.getElementSize();
        const from = given.getArray();
        turned.setArray(from.map((_, i) => from[(count - 1 - Math.floor(i / size)) * size + (i % size)]));
        owner.setAttribute(semantic, turned);
      }
    };
    [primitive, ...primitive.listTargets()].forEach(backwards);
    const indices = primitive.getIndices()?.getArray() ?? Uint32Array.from({ length: count }, (_, i) => i);
    const buffer = root.listBuffers()[0];
    const turned = document.createAccessor().setType('SCALAR').setBuffer(buffer);
    primitive.setIndices(turned.setArray(indices.map((vertex) => count - 1 - vertex)));
  }
}

const GLTFPACK = { gltfpack: [], 'gltfpack-noq': ['-noq', '-km'], 'gltfpack-keep': ['-ke', '-kn', '-km', '-noq'] };

async function transform() {
  const { Logger, NodeIO } = await load('@gltf-transform/core');
  const { ALL_EXTENSIONS } = await load('@gltf-transform/extensions');
  const { dedup, flatten, instance, join, meshopt, prune, quantize } = await load('@gltf-transform/functions');
  const { MeshoptDecoder: decoder, MeshoptEncoder: encoder } = await load('meshoptimizer');
  await Promise.all([decoder.ready, encoder.ready]);
  const io = new NodeIO()
    .registerExtensions(ALL_EXTENSIONS)
    .registerDependencies({ 'meshopt.decoder': decoder, 'meshopt.encoder': encoder });
  const document = await io.read(input);
  document.setLogger(new Logger(Logger.Verbosity.ERROR));
  const operations = {
    blender: () => throughBlender,
    copy: () => () => {},
    dedup,
    flatten,
    instance: () => instance({ min: 2 }),
    join,
    meshopt: () => meshopt({ encoder }),
    prune,
    quantize,
  };
  await document.transform(operations[operation]());
  await io.write(output, document);
}

if (operation in GLTFPACK) {
  const cli = path.join(path.dirname(resolve('gltfpack')), 'cli.js');
  execFileSync(process.execPath, [cli, '-i', input, '-o', output, ...GLTFPACK[operation]]);
} else {
  await transform();
}
