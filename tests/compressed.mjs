// node compressed.mjs write MODULES FOLDER: writes the compressed samples of formats/tests/compressed.
// node compressed.mjs decode MODULES FILE: prints the accessors of a file's primitives as other tools decode them.
//
// MODULES is the folder of tests/package.json's packages.
import { mkdirSync, readFileSync, writeFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import path from 'node:path';
import { pathToFileURL } from 'node:url';

const [command, modules, place] = process.argv.slice(2);
const require = createRequire(path.resolve(modules, 'package.json'));
const load = (name) => import(pathToFileURL(require.resolve(name)));
const bytesOf = (array) => new Uint8Array(array.buffer, array.byteOffset, array.byteLength);

const FLOAT = 5126, INT8 = 5120, UINT8 = 5121, INT16 = 5122, UINT16 = 5123, UINT32 = 5125;
const COMPONENTS = { SCALAR: 1, VEC2: 2, VEC3: 3, VEC4: 4 };

// Two linked rings with all attributes: positions, normals, tangents, texture coordinates and colours of each vertex.
function ring(around, across, turn) {
  const all = { POSITION: [], NORMAL: [], TANGENT: [], TEXCOORD_0: [], COLOR_0: [] };
  for (let i = 0; i <= around; i++) {
    for (let j = 0; j <= across; j++) {
      const [u, v] = [i / around, j / across];
      const [a, b] = [2 * Math.PI * u, 2 * Math.PI * v];
      const [x, y, z] = [Math.cos(a) * Math.cos(b), Math.sin(a) * Math.cos(b), Math.sin(b)];
      const place = [(2 + 0.5 * Math.cos(b)) * Math.cos(a), (2 + 0.5 * Math.cos(b)) * Math.sin(a), 0.5 * Math.sin(b)];
      const turned = ([x, y, z]) => (turn ? [x + 0.7, -z, y] : [x, y, z]);
      const direction = ([x, y, z]) => (turn ? [x, -z, y] : [x, y, z]);
      all.POSITION.push(...turned(place));
      all.NORMAL.push(...direction([x, y, z]));
      all.TANGENT.push(...direction([-Math.sin(a), Math.cos(a), 0]), turn ? -1 : 1);
      all.TEXCOORD_0.push(3 * u, v);
      all.COLOR_0.push(0.5 + 0.5 * x, 0.5 + 0.5 * y, 0.5 + 0.5 * z, 1 - 0.25 * v);
    }
  }
  const indices = [];
  for (let i = 0; i < around; i++) {
    for (let j = 0; j < across; j++) {
      const at = i * (across + 1) + j;
      indices.push(at, at + across + 1, at + across + 2, at, at + across + 2, at + 1);
    }
  }
  for (const name in all) all[name] = Float32Array.from(all[name]);
  return { attributes: all, indices: Uint32Array.from(indices), count: (around + 1) * (across + 1) };
}

const bounds = (array, size) => {
  const [min, max] = [Array(size).fill(Infinity), Array(size).fill(-Infinity)];
  array.forEach((x, i) => {
    min[i % size] = Math.min(min[i % size], x);
    max[i % size] = Math.max(max[i % size], x);
  });
  return { min, max };
};

// A GLB file whose buffer views are compressed under the extension's name, in its version of the codec.
class Meshopt {
  constructor(encoder, decoder, name, version) {
    Object.assign(this, { encoder, decoder, name, version, length: 0, unpacked: 0, pieces: [] });
    this.json = {
      asset: { version: '2.0' }, scene: 0, scenes: [{ nodes: [] }], nodes: [], meshes: [], accessors: [], bufferViews: [],
      extensionsUsed: [name, 'KHR_mesh_quantization'], extensionsRequired: [name, 'KHR_mesh_quantization'],
    };
  }

  // Adds an accessor of `count` elements of `stride` bytes, from bytes before the filter; returns its index.
  accessor(source, count, stride, mode, filter, properties) {
    const stream = this.encoder.encodeGltfBuffer(source, count, stride, mode, this.version);
    const view = { buffer: 1, byteOffset: this.unpacked, byteLength: count * stride };
    if (mode === 'ATTRIBUTES' && !properties.animation) view.byteStride = stride;
    const compressed = { buffer: 0, byteOffset: this.length, byteLength: stream.length, byteStride: stride, mode, count };
    if (filter !== 'NONE') compressed.filter = filter;
    view.extensions = { [this.name]: compressed };
    this.unpacked += view.byteLength + (-view.byteLength & 3);
    this.pieces.push(stream, new Uint8Array(-stream.length & 3));
    this.length += stream.length + (-stream.length & 3);
    this.json.bufferViews.push(view);
    const { animation, ...rest } = properties;
    return this.json.accessors.push({ bufferView: this.json.bufferViews.length - 1, count, ...rest }) - 1;
  }

  floats(array, type, more = {}) {
    const stride = 4 * COMPONENTS[type];
    const source = bytesOf(array);
    return this.accessor(source, array.length * 4 / stride, stride, 'ATTRIBUTES', 'NONE', { componentType: FLOAT, type, ...more });
  }

  // A filtered accessor; `encoded` is what the encoder of the filter made.
  filtered(encoded, count, stride, filter, properties) {
    return this.accessor(encoded, count, stride, 'ATTRIBUTES', filter, properties);
  }

  indices(array, mode, componentType) {
    const source = bytesOf(componentType === UINT16 ? Uint16Array.from(array) : array);
    return this.accessor(source, array.length, componentType === UINT16 ? 2 : 4, mode, 'NONE', { componentType, type: 'SCALAR' });
  }

  node(mesh, more = {}) {
    this.json.meshes.push(mesh);
    this.json.scenes[0].nodes.push(this.json.nodes.push({ name: mesh.name, mesh: this.json.meshes.length - 1, ...more }) - 1);
  }

  write(file) {
    const fallback = { byteLength: this.unpacked, extensions: { [this.name]: { fallback: true } } };
    this.json.buffers = [{ byteLength: this.length }, fallback];
    const text = Buffer.from(JSON.stringify(this.json));
    const json = Buffer.concat([text, Buffer.alloc(-text.length & 3, ' ')]);
    const head = Buffer.from('glTF\x02\0\0\0\0\0\0\0\0\0\0\0JSON\0\0\0\0BIN\0', 'latin1');
    head.writeUInt32LE(28 + json.length + this.length, 8);
    head.writeUInt32LE(json.length, 12);
    head.writeUInt32LE(this.length, 20);
    writeFileSync(file, Buffer.concat([head.subarray(0, 20), json, head.subarray(20), ...this.pieces]));
  }
}

// All modes and filters of the extension's version.
function meshopt(file, encoder, decoder, name, version) {
  const out = new Meshopt(encoder, decoder, name, version);
  const isKhronos = version > 0;
  const attributes = ({ attributes: a, count }) => ({
    POSITION: out.floats(a.POSITION, 'VEC3', bounds(a.POSITION, 3)),
    NORMAL: out.filtered(encoder.encodeFilterOct(spread(a.NORMAL, 3), count, 4, 8), count, 4, 'OCTAHEDRAL', { componentType: INT8, normalized: true, type: 'VEC3' }),
    TANGENT: out.filtered(encoder.encodeFilterOct(a.TANGENT, count, 8, 12), count, 8, 'OCTAHEDRAL', { componentType: INT16, normalized: true, type: 'VEC4' }),
    TEXCOORD_0: out.filtered(encoder.encodeFilterExp(a.TEXCOORD_0, count, 8, 15), count, 8, 'EXPONENTIAL', { componentType: FLOAT, type: 'VEC2' }),
    ...(isKhronos && {
      COLOR_0: out.filtered(encoder.encodeFilterColor(a.COLOR_0, count, 4, 8), count, 4, 'COLOR', { componentType: UINT8, normalized: true, type: 'VEC4' }),
      COLOR_1: out.filtered(encoder.encodeFilterColor(a.COLOR_0, count, 8, 12), count, 8, 'COLOR', { componentType: UINT16, normalized: true, type: 'VEC4' }),
    }),
  });
  const [flat, turned] = [ring(32, 12, false), ring(32, 12, true)];
  const mesh = (name, ring, mode, type) => ({ name, primitives: [{ attributes: attributes(ring), indices: out.indices(ring.indices, mode, type) }] });
  out.node(mesh('flat ring', flat, 'TRIANGLES', UINT16));
  out.node(mesh('turned ring', turned, 'INDICES', UINT32));
  const far = mesh('far ring', flat, 'TRIANGLES', UINT32);
  out.node(far, { translation: [9, 0, 0] });
  const turns = 20;
  const quaternions = Float32Array.from({ length: 4 * turns }, (_, i) => [0, 0, Math.sin, Math.cos][i % 4] && [0, 0, Math.sin, Math.cos][i % 4](0.1 * Math.floor(i / 4)));
  const times = Float32Array.from({ length: turns }, (_, i) => 0.25 * i);
  const input = out.floats(times, 'SCALAR', { animation: true, ...bounds(times, 1) });
  const output = out.filtered(encoder.encodeFilterQuat(quaternions, turns, 8, 12), turns, 8, 'QUATERNION', { animation: true, componentType: INT16, normalized: true, type: 'VEC4' });
  out.json.animations = [{ channels: [{ sampler: 0, target: { node: 2, path: 'rotation' } }], samplers: [{ input, output }] }];
  out.write(file);
}

// Vectors of so many components with zeros appended, four each.
function spread(array, size) {
  return Float32Array.from({ length: (array.length / size) * 4 }, (_, i) => (i % 4 < size ? array[Math.floor(i / 4) * size + (i % 4)] : 0));
}

// A GLB file with both rings, compressed by Draco in one of its two ways.
async function draco(file, method) {
  const { Document, NodeIO } = await load('@gltf-transform/core');
  const { KHRDracoMeshCompression } = await load('@gltf-transform/extensions');
  const document = new Document();
  const buffer = document.createBuffer();
  const scene = document.createScene();
  const accessor = (array, type, normalized = false) => document.createAccessor().setBuffer(buffer).setType(type).setArray(array).setNormalized(normalized);
  for (const turn of [false, true]) {
    const { attributes: a, indices, count } = ring(32, 12, turn);
    const primitive = document.createPrimitive()
      .setIndices(accessor(turn ? indices : Uint16Array.from(indices), 'SCALAR'))
      .setAttribute('POSITION', accessor(a.POSITION, 'VEC3'))
      .setAttribute('NORMAL', accessor(a.NORMAL, 'VEC3'))
      .setAttribute('TEXCOORD_0', accessor(a.TEXCOORD_0, 'VEC2'))
      .setAttribute('COLOR_0', accessor(Uint8Array.from(a.COLOR_0, (x) => Math.round(255 * x)), 'VEC4', true))
      .setAttribute('_PART', accessor(Uint16Array.from({ length: count }, (_, i) => 300 * (i % 7)), 'SCALAR'));
    const name = turn ? 'turned ring' : 'flat ring';
    scene.addChild(document.createNode(name).setMesh(document.createMesh(name).addPrimitive(primitive)));
  }
  document.createExtension(KHRDracoMeshCompression).setRequired(true).setEncoderOptions({ method: KHRDracoMeshCompression.EncoderMethod[method] });
  const io = new NodeIO().registerExtensions([KHRDracoMeshCompression]);
  io.registerDependencies({ 'draco3d.encoder': await require('draco3dgltf').createEncoderModule() });
  await io.write(file, document);
}

async function write() {
  const { MeshoptEncoder, MeshoptDecoder } = await load('meshoptimizer');
  await Promise.all([MeshoptEncoder.ready, MeshoptDecoder.ready]);
  mkdirSync(place, { recursive: true });
  meshopt(path.join(place, 'meshopt.glb'), MeshoptEncoder, MeshoptDecoder, 'EXT_meshopt_compression', 0);
  meshopt(path.join(place, 'meshopt_khr.glb'), MeshoptEncoder, MeshoptDecoder, 'KHR_meshopt_compression', 1);
  await draco(path.join(place, 'draco.glb'), 'EDGEBREAKER');
  await draco(path.join(place, 'draco_sequential.glb'), 'SEQUENTIAL');
}

// The bytes of a file, with the Khronos name of the meshopt extension replaced by the older one, which is the one that
// glTF Transform knows; the names have the same length, and the decoder is the same.
function renamed(file) {
  const bytes = readFileSync(file);
  for (let at = 0; (at = bytes.indexOf('KHR_meshopt_compression', at)) >= 0; ) bytes.write('EXT', at);
  return bytes;
}

// A .gltf file with its buffers; images, which nobody compares, are left empty.
function withBuffers(file) {
  const json = JSON.parse(renamed(file));
  const read = ({ uri }) => [uri, new Uint8Array(readFileSync(path.join(path.dirname(file), decodeURIComponent(uri))))];
  const images = (json.images ?? []).filter(({ uri }) => uri && !uri.startsWith('data:')).map(({ uri }) => [uri, new Uint8Array()]);
  const buffers = json.buffers.filter(({ uri }) => uri && !uri.startsWith('data:')).map(read);
  return { json, resources: Object.fromEntries([...images, ...buffers]) };
}

async function open(file) {
  const { NodeIO, Logger } = await load('@gltf-transform/core');
  const { ALL_EXTENSIONS } = await load('@gltf-transform/extensions');
  const { MeshoptDecoder } = await load('meshoptimizer');
  await MeshoptDecoder.ready;
  const io = new NodeIO().setLogger(new Logger(Logger.Verbosity.ERROR)).registerExtensions(ALL_EXTENSIONS);
  io.registerDependencies({ 'meshopt.decoder': MeshoptDecoder, 'draco3d.decoder': await require('draco3dgltf').createDecoderModule() });
  return file.endsWith('.glb') ? io.readBinary(renamed(file)) : io.readJSON(withBuffers(file));
}

async function decode() {
  const shown = (accessor) => accessor && { componentType: accessor.getComponentType(), type: accessor.getType(), base64: Buffer.from(bytesOf(accessor.getArray())).toString('base64') };
  const primitive = (p) => ({
    attributes: Object.fromEntries(p.listSemantics().map((name) => [name, shown(p.getAttribute(name))])),
    indices: shown(p.getIndices()),
  });
  const root = (await open(place)).getRoot();
  const meshes = root.listMeshes().map((mesh) => mesh.listPrimitives().map(primitive));
  const animations = root.listAnimations().flatMap((a) => a.listSamplers().map((s) => [shown(s.getInput()), shown(s.getOutput())]));
  process.stdout.write(JSON.stringify({ meshes, animations }));
}

await { write, decode }[command]();
