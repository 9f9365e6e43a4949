// The places of corners of a glTF file at some instants, by three.js: node poses.mjs FILE ASK.json
import { readFileSync } from 'node:fs';
import { pathToFileURL } from 'node:url';
import path from 'node:path';

const three = path.join(process.env.NODE_PATH, 'three');
const load = name => import(pathToFileURL(path.join(three, name)));
const [file, asked] = process.argv.slice(2);
const { times, corners } = JSON.parse(readFileSync(asked));
globalThis.self = globalThis;
globalThis.ProgressEvent ??= class {};
const { AnimationMixer, LoopOnce, Vector3 } = await load('build/three.module.js');
const { GLTFLoader } = await load('examples/jsm/loaders/GLTFLoader.js');
const gltf = await new GLTFLoader().parseAsync(readFileSync(file, 'utf8'), '');
const meshes = [];
gltf.scene.traverse(each => { if (each.isMesh) meshes.push(each); });
const mixer = new AnimationMixer(gltf.scene), action = mixer.clipAction(gltf.animations[0]);
action.setLoop(LoopOnce);
action.clampWhenFinished = true;
action.play();
const places = times.map(time => {
  mixer.setTime(time);
  gltf.scene.updateMatrixWorld(true);
  return corners.map(([part, corner]) => {
    const mesh = meshes[part], index = mesh.geometry.index;
    const point = mesh.getVertexPosition(index ? index.getX(corner) : corner, new Vector3());
    return point.applyMatrix4(mesh.matrixWorld).toArray();
  });
});
console.log(JSON.stringify(places));
