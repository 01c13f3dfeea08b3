// Skeletons on a floor. One renderer draws for all: off the page, copied to where it is seen.

const ABOVE = 0.3; // metres left free above the highest joint
const HEIGHT_SEEN = 2.2; // metres from the lower to the upper edge of a view
const FIELD = 26; // degrees
const GRID = 0.5; // metres between lines of the floor
const BESIDE = 1.15; // metres between a hit and what it is compared with
const FIRST_VIEW = { azimuth: 0.6, elevation: 0.2, distance: 1 };
const SLIM = { beside: 0.85, over: 0.6 }; // what lies over a hit hides in it where both agree
const CARD_VIEW = { azimuth: 0.6, elevation: 0.2, distance: 0.88 };
const THICK = {
  root: 0.06, belly: 0.07, chest: 0.07, neck: 0.048, head: 0.04,
  hip: 0.06, knee: 0.052, ankle: 0.042, toes: 0.034,
  clavicle: 0.045, shoulder: 0.046, elbow: 0.04, wrist: 0.033, fingers: 0.028,
};

function thickness(joint) {
  const name = data.joints[joint];
  return THICK[data.sides[joint] === "m" ? name : name.slice(1)] ?? 0.04;
}

/** Bones and joints as instances of one cylinder and one ball: a figure is three meshes. */
class Figure {
  constructor(scene, geometry, pale) {
    const count = data.joints.length;
    this.pale = pale;
    this.material = new THREE.MeshLambertMaterial();
    this.flat = new THREE.MeshBasicMaterial();
    this.bones = new THREE.InstancedMesh(geometry.bone, this.material, count);
    this.balls = new THREE.InstancedMesh(geometry.ball, this.material, count + 2); // and the trunk
    this.shadow = new THREE.Group();
    // The sun stands high at the back on the left: what is up falls to the front on the right.
    this.shadow.matrix.set(1, 0.25, 0, 0, 0, 0, 0, 0.004, 0, 0.12, 1, 0, 0, 0, 0, 1);
    this.shadow.matrixAutoUpdate = false;
    this.group = new THREE.Group();
    this.group.add(this.bones, this.balls, this.shadow);
    for (const mesh of [this.bones, this.balls]) {
      const cast = new THREE.InstancedMesh(mesh.geometry, this.flat, mesh.count);
      cast.instanceMatrix = mesh.instanceMatrix;
      this.shadow.add(cast);
      mesh.frustumCulled = cast.frustumCulled = false;
    }
    scene.add(this.group);
    this.paint();
  }

  paint() {
    const end = this.pale ? "-pale" : "";
    const paints = { l: `left${end}`, r: `right${end}`, m: `middle${end}` };
    const paint = new THREE.Color();
    for (let joint = 0; joint < data.joints.length; joint += 1) {
      paint.setStyle(colour(paints[data.sides[joint]]));
      this.bones.setColorAt(joint, paint);
      this.balls.setColorAt(joint, paint);
    }
    paint.setStyle(colour(paints.m));
    for (const extra of [0, 1]) this.balls.setColorAt(data.joints.length + extra, paint);
    this.bones.instanceColor.needsUpdate = this.balls.instanceColor.needsUpdate = true;
    this.flat.color.setStyle(colour("shadow"));
  }

  /** Take on a pose: joint positions, and the height of the ground; slim by a share of what is usual. */
  pose(pose, size, floor, share = 1) {
    const slim = share * size;
    const at = (joint) => new THREE.Vector3(pose[3 * joint], pose[3 * joint + 1] - floor, pose[3 * joint + 2]);
    const points = data.joints.map((_, joint) => at(joint));
    const there = points.map((point) => !Number.isNaN(point.x));
    for (let joint = 0; joint < points.length; joint += 1) {
      let parent = data.parents[joint];
      while (parent >= 0 && !there[parent]) parent = data.parents[parent];
      const thick = slim * thickness(joint);
      const [bone, ball] = [there[joint] && parent >= 0, there[joint]];
      const along = bone ? new THREE.Vector3().subVectors(points[joint], points[parent]) : UP;
      const length = along.length();
      const middle = bone ? points[parent].clone().lerp(points[joint], 0.5) : UP;
      const turn = new THREE.Quaternion().setFromUnitVectors(UP, along.clone().normalize());
      set(this.bones, joint, bone, middle, turn, [thick, length, thick]);
      if (bone && joint === JOINT.headtop) {
        // The head is one ball, longer than wide, from the neck's end to the crown.
        const wide = share * Math.min(Math.max(0.78 * length, 0.07 * size), 0.14 * size);
        set(this.balls, joint, ball, middle, turn, [wide, 1.2 * wide, wide]);
      } else {
        set(this.balls, joint, ball, points[joint], turn, [thick, thick, thick]);
      }
    }
    const { root, belly, chest, neck, lhip, rhip, lshoulder, rshoulder } = JOINT;
    const all = (parts) => parts.map((part) => part * share);
    this.trunk(0, points, there, [belly, neck, lshoulder, rshoulder], size, all([0.41, 0.66, 0.2]));
    this.trunk(1, points, there, [root, chest, lhip, rhip], size, all([0.72, 0.62, 0.42]));
    this.bones.instanceMatrix.needsUpdate = this.balls.instanceMatrix.needsUpdate = true;
  }

  /** A ball for the chest or the pelvis: as wide as the limbs stand apart, as high as the spine. */
  trunk(number, points, there, joints, size, [wide, high, deep]) {
    const [low, top, left, right] = joints.map((joint) => points[joint]);
    const known = joints.every((joint) => there[joint]);
    const along = new THREE.Vector3().subVectors(top, low);
    const across = new THREE.Vector3().subVectors(left, right);
    const [length, width] = [along.length(), across.length()];
    along.normalize();
    const forth = new THREE.Vector3().crossVectors(across, along).normalize();
    const basis = new THREE.Matrix4().makeBasis(new THREE.Vector3().crossVectors(along, forth), along, forth);
    const turn = new THREE.Quaternion().setFromRotationMatrix(basis);
    const middle = number ? low.clone().lerp(top, 0.2) : low.clone().lerp(top, 0.5);
    const depth = Math.max(deep * width, 0.35 * deep * size);
    set(this.balls, data.joints.length + number, known, middle, turn, [wide * width, high * length, depth]);
  }
}

/** Place an instance of a mesh, or hide it. */
function set(mesh, number, seen, middle, turn, scale) {
  const matrix = seen ? PLACE.compose(middle, turn, SCALE.fromArray(scale)) : PLACE.makeScale(0, 0, 0);
  mesh.setMatrixAt(number, matrix);
}

const PLACE = new THREE.Matrix4();
const SCALE = new THREE.Vector3();
const UP = new THREE.Vector3(0, 1, 0);

/** Draws views of clips into canvases. */
class Studio {
  constructor() {
    this.renderer = new THREE.WebGLRenderer({ antialias: true, powerPreference: "low-power" });
    this.renderer.domElement.addEventListener("webglcontextrestored", () => lookChanged());
    this.renderer.setScissorTest(true);
    this.scene = new THREE.Scene();
    this.scene.fog = new THREE.Fog(0, 1, 10);
    this.camera = new THREE.PerspectiveCamera(FIELD, 1, 0.05, 200);
    const sun = new THREE.DirectionalLight(0xffffff, 2.1);
    sun.position.set(-1, 2.2, 1.2);
    this.sun = sun;
    this.scene.add(sun, sun.target, new THREE.HemisphereLight(0xffffff, 0x8890a0, 1.6));
    const bone = new THREE.CylinderGeometry(1, 1, 1, 14, 1, true);
    const geometry = { bone, ball: new THREE.SphereGeometry(1, 18, 12) };
    this.figure = new Figure(this.scene, geometry, false);
    this.other = new Figure(this.scene, geometry, true);
    this.grid = this.makeGrid();
    this.scene.add(this.grid);
    this.paint();
  }

  makeGrid() {
    const points = [];
    const half = 9;
    // Short lines: some programs that draw lose long ones that pass behind the camera.
    for (let line = -half; line <= half; line += GRID) {
      for (let from = -half; from < half; from += 1) {
        points.push(from, 0, line, from + 1, 0, line, line, 0, from, line, 0, from + 1);
      }
    }
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.Float32BufferAttribute(points, 3));
    const grid = new THREE.LineSegments(geometry, new THREE.LineBasicMaterial());
    grid.frustumCulled = false;
    return grid;
  }

  paint() {
    this.renderer.setClearColor(new THREE.Color().setStyle(colour("backdrop")), 1);
    this.scene.fog.color.setStyle(colour("backdrop"));
    this.grid.material.color.setStyle(colour("floor-line"));
    this.figure.paint();
    this.other.paint();
  }

  /** Draw a clip at a frame; `other` is { clip, frame, mode } of what it is compared with. */
  draw(canvas, clip, frame, view, other = null) {
    const { width, height } = canvas;
    const size = this.renderer.domElement;
    if (size.width < width || size.height < height) {
      this.renderer.setSize(Math.max(size.width, width), Math.max(size.height, height), false);
    }
    const pose = poseAt(clip.piece, frame);
    const target = this.target(clip, frame);
    const azimuth = clip.facing + view.azimuth;
    const right = [Math.cos(azimuth), -Math.sin(azimuth)];
    this.figure.pose(pose, clip.size, clip.floor);
    this.other.group.visible = other !== null;
    const beside = other !== null && other.mode === "beside";
    if (other !== null) this.place(other, clip, pose, beside ? right : [0, 0]);
    const middle = beside ? (BESIDE * clip.size) / 2 : 0;
    const centre = target.map((place, i) => place + middle * right[i]);
    this.look(clip, centre, azimuth, view, width / height, beside);
    const bottom = size.height - height;
    this.renderer.setViewport(0, bottom, width, height);
    this.renderer.setScissor(0, bottom, width, height);
    this.renderer.render(this.scene, this.camera);
    canvas.getContext("2d", { alpha: false }).drawImage(size, 0, 0, width, height, 0, 0, width, height);
  }

  /** Where the camera looks: at a person who stays, after one who goes. */
  target(clip, frame) {
    const around = 0.6 * data.rate;
    const sum = [0, 0];
    const places = 7;
    for (let i = 0; i < places; i += 1) {
      const at = frame + around * ((2 * i) / (places - 1) - 1);
      const pose = poseAt(clip.piece, Math.min(Math.max(at, clip.start), clip.end - 1));
      sum[0] += pose[0] / places;
      sum[1] += pose[2] / places;
    }
    return sum.every(Number.isFinite) ? sum : [0, 0];
  }

  /** Put the other figure where the first one is, facing as it did at the beginning. */
  place(other, clip, pose, right) {
    const { clip: its } = other;
    const theirs = poseAt(its.piece, other.frame);
    const scale = clip.size / its.size;
    const turn = clip.facing - its.facing;
    const [sin, cos] = [Math.sin(turn), Math.cos(turn)];
    const [x0, z0] = [theirs[0], theirs[2]];
    const away = BESIDE * clip.size;
    for (let i = 0; i < theirs.length; i += 3) {
      const [x, z] = [(theirs[i] - x0) * scale, (theirs[i + 2] - z0) * scale];
      theirs[i] = pose[0] + cos * x + sin * z + away * right[0];
      theirs[i + 1] = (theirs[i + 1] - its.floor) * scale;
      theirs[i + 2] = pose[2] - sin * x + cos * z + away * right[1];
    }
    this.other.pose(theirs, clip.size, 0, SLIM[other.mode]);
  }

  look(clip, [x, z], azimuth, view, aspect, beside) {
    const wide = (beside ? 2.7 : 1.7) / aspect;
    const tall = Math.max(HEIGHT_SEEN * clip.size, clip.top + ABOVE);
    const seen = Math.max(tall, wide * clip.size) * view.distance;
    const away = seen / 2 / Math.tan((FIELD / 2) * (Math.PI / 180));
    const level = Math.cos(view.elevation) * away;
    const height = 0.9 * clip.size + (tall - HEIGHT_SEEN * clip.size) / 2;
    this.camera.aspect = aspect;
    const above = height + Math.sin(view.elevation) * away;
    this.camera.position.set(x + Math.sin(azimuth) * level, above, z + Math.cos(azimuth) * level);
    this.camera.lookAt(x, height, z);
    this.camera.updateProjectionMatrix();
    this.sun.target.position.set(x, 0, z);
    this.sun.position.set(x + Math.sin(azimuth - 0.7) * 2, 3, z + Math.cos(azimuth - 0.7) * 2);
    this.scene.fog.near = away;
    this.scene.fog.far = away + 7 * clip.size;
    const step = GRID * clip.size;
    this.grid.scale.setScalar(clip.size);
    this.grid.position.set(Math.round(x / step) * step, 0, Math.round(z / step) * step);
  }
}
