// The picture: bodies, light, ground, camera. Metres inside `world`, which is scaled to a unit scene.

import {
  Color, DirectionalLight, Group, HemisphereLight, Mesh, NeutralToneMapping, PCFShadowMap, PerspectiveCamera,
  PlaneGeometry, PMREMGenerator, Quaternion, RoomEnvironment, Scene, ShaderMaterial, ShadowMaterial, OrbitControls,
  Vector3, WebGLRenderer,
} from "three";
import { BodyMesh } from "palpate/bodies";

/** Frames per second below which shadows are given up. */
const SLOW = 18;

export class Stage {
  constructor(container) {
    this.container = container;
    this.renderer = new WebGLRenderer({ antialias: true, alpha: true, powerPreference: "high-performance" });
    this.renderer.toneMapping = NeutralToneMapping;
    this.renderer.toneMappingExposure = 0.92;
    this.renderer.shadowMap.type = PCFShadowMap;
    this.plain = drawsInSoftware(this.renderer);
    this.renderer.shadowMap.enabled = !this.plain;
    this.canvas = this.renderer.domElement;
    container.prepend(this.canvas);
    this.scene = new Scene();
    this.camera = new PerspectiveCamera(32, 1, 0.02, 100);
    this.controls = new OrbitControls(this.camera, this.canvas);
    Object.assign(this.controls, { enableDamping: true, dampingFactor: 0.15, maxDistance: 30, minDistance: 0.15 });
    this.controls.addEventListener("change", () => this.touch());
    this.controls.addEventListener("start", () => (this.cameraMoved = true));
    this.world = new Group();
    this.scene.add(this.world);
    this.bodies = [];
    this.covered = 0;
    this.frames = 0;
    this.light();
    this.ground = makeGround();
    this.scene.add(this.ground.shadow, this.ground.grid);
    new ResizeObserver(() => this.resize()).observe(container);
    this.resize();
    this.renderer.setAnimationLoop((now) => this.draw(now));
  }

  light() {
    if (this.plain) {
      this.scene.add(new HemisphereLight(0xffffff, 0xd0c8c0, 2.9));
      const key = new DirectionalLight(0xfff6ec, 1.8);
      key.position.set(-1.6, 3.4, 2.2);
      this.scene.add(key);
      return;
    }
    const generator = new PMREMGenerator(this.renderer);
    this.scene.environment = generator.fromScene(new RoomEnvironment(), 0.04).texture;
    this.scene.environmentIntensity = 0.55;
    generator.dispose();
    this.scene.add(new HemisphereLight(0xffffff, 0xc9c2bb, 0.55));
    const key = new DirectionalLight(0xfff6ec, 1.9);
    key.position.set(-1.6, 3.4, 2.2);
    key.castShadow = true;
    key.shadow.mapSize.set(2048, 2048);
    Object.assign(key.shadow.camera, { left: -1.7, right: 1.7, top: 1.7, bottom: -1.7, near: 0.5, far: 8 });
    key.shadow.radius = 5;
    key.shadow.bias = -0.0004;
    key.shadow.normalBias = 0.012;
    const rim = new DirectionalLight(0xdfeaff, 0.7);
    rim.position.set(2.2, 1.2, -2.4);
    this.scene.add(key, rim);
  }

  /** Take over a scene message; `keepCamera` when it is the same scene with another topology. */
  setScene({ header, arrays }, keepCamera) {
    const styles = keepCamera ? new Map(this.bodies.map((body) => [body.look.name, body])) : new Map();
    for (const body of this.bodies) {
      this.world.remove(body);
      body.dispose();
    }
    let start = 0;
    let firstTriangle = 0;
    this.bodies = header.bodies.map((look, i) => {
      const body = new BodyMesh(look, this.plain, arrays[`rest/${i}`], arrays[`triangles/${i}`], arrays[`cut/${i}`], start, firstTriangle);
      start += body.nodeCount;
      firstTriangle += body.triangles.length / 3;
      const before = styles.get(look.name);
      if (before) {
        body.visible = before.visible;
        body.restyle({ color: before.look.color, opacity: before.look.opacity, wireframe: before.material.wireframe });
      }
      this.world.add(body);
      return body;
    });
    this.nodeCount = start;
    this.triangleCount = firstTriangle;
    if (!keepCamera) this.place(header);
    this.world.updateMatrixWorld(true); // picking may come before the next picture
    this.touch();
  }

  /** Turn and scale the world so that up is up and the soft bodies are about two units wide. */
  place({ up, bounds }) {
    const [low, high] = bounds.soft.map((corner) => new Vector3(...corner));
    const [lowest, highest] = bounds.all.map((corner) => new Vector3(...corner));
    const size = high.distanceTo(low) || 1;
    this.size = size;
    const turn = new Quaternion().setFromUnitVectors(new Vector3(...up), new Vector3(0, 1, 0));
    this.world.quaternion.copy(turn);
    this.world.scale.setScalar(2 / size);
    this.world.position.set(0, 0, 0);
    this.world.updateMatrixWorld();
    const center = this.world.localToWorld(low.clone().add(high).multiplyScalar(0.5));
    let floor = Infinity;
    for (let corner = 0; corner < 8; corner++) {
      const at = new Vector3(...[0, 1, 2].map((k) => ((corner >> k) & 1 ? highest : lowest).getComponent(k)));
      floor = Math.min(floor, this.world.localToWorld(at).y);
    }
    this.world.position.set(-center.x, -floor, -center.z);
    this.world.updateMatrixWorld();
    const step = niceLength(size / 4);
    this.ground.grid.material.uniforms.cell.value = (step * 2) / size;
    this.gridLength = step;
    this.frameCamera();
  }

  /** Show the soft bodies as they lie now, from above the horizon. */
  frameCamera() {
    const low = new Vector3(Infinity, Infinity, Infinity), high = low.clone().negate(), at = new Vector3();
    const soft = this.bodies.filter((body) => body.visible && !body.look.rigid);
    for (const { geometry } of soft.length ? soft : this.bodies) {
      const { array } = geometry.attributes.position;
      for (let i = 0; i < array.length; i += 3) {
        this.world.localToWorld(at.fromArray(array, i));
        low.min(at);
        high.max(at);
      }
    }
    if (!(low.x <= high.x)) return;
    this.cameraMoved = false;
    const half = Math.tan((this.camera.fov * Math.PI) / 360);
    const reach = Math.max(0.3, high.distanceTo(low) / 2);
    const distance = (1.05 * reach) / (half * Math.min(1, this.camera.aspect * (1 - this.covered / this.container.clientWidth)));
    this.controls.target.copy(low).add(high).multiplyScalar(0.5);
    this.camera.position.set(0.48, 0.5, 1).normalize().multiplyScalar(distance).add(this.controls.target);
    this.controls.update();
    this.touch();
  }

  /** Move the bodies to a frame's positions. */
  move(positions) {
    for (const body of this.bodies) body.move(positions);
    this.touch();
  }

  /** The scene as PNG with a clear background, as large as it is shown. */
  picture() {
    this.renderer.render(this.scene, this.camera);
    return new Promise((done) => this.canvas.toBlob(done, "image/png"));
  }

  /** Something changed: draw again. */
  touch() {
    this.dirty = true;
  }

  /** So many pixels at the right are covered: the middle is in the rest. */
  cover(pixels) {
    this.covered = pixels;
    this.resize();
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.container;
    if (width === 0 || height === 0) return;
    this.renderer.setPixelRatio(this.plain ? 1 : Math.min(devicePixelRatio, 2));
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.setViewOffset(width, height, this.covered / 2, 0, width, height); // updates the projection
    this.touch();
  }

  draw(now) {
    this.controls.update();
    if (!this.dirty) {
      this.since = undefined;
      return;
    }
    this.dirty = false;
    this.beforeDraw?.();
    this.renderer.render(this.scene, this.camera);
    this.afterDraw?.();
    this.frames += 1;
    this.adapt(now);
  }

  /** Give up shadows, then fine pixels, on a machine that cannot keep up. */
  adapt(now) {
    if (this.since === undefined) [this.since, this.counted] = [now, 0];
    this.counted += 1;
    if (now - this.since < 2500) return;
    const rate = (1000 * (this.counted - 1)) / (now - this.since);
    this.since = undefined;
    if (rate >= SLOW || this.counted < 3) return;
    if (this.renderer.shadowMap.enabled) this.shadows(false);
    else if (this.renderer.getPixelRatio() > 0.75) this.renderer.setPixelRatio(0.75);
    this.touch(); // a new size clears the canvas
  }

  shadows(on) {
    this.renderer.shadowMap.enabled = on;
    this.scene.traverse((each) => each.material && (each.material.needsUpdate = true));
    this.touch();
  }
}

/** The largest of 1, 2, 5 times a power of ten that is not above a length. */
export function niceLength(length) {
  const power = 10 ** Math.floor(Math.log10(length));
  return power * [5, 2, 1].find((factor) => factor * power <= length * (1 + 1e-9));
}

/** Whether the processor draws, as on a machine without a graphics card: light must then be simple. */
function drawsInSoftware(renderer) {
  const forced = new URLSearchParams(location.search).get("quality");
  if (forced) return forced === "low";
  const context = renderer.getContext();
  const names = context.getExtension("WEBGL_debug_renderer_info");
  const name = names ? String(context.getParameter(names.UNMASKED_RENDERER_WEBGL)) : "";
  return /swiftshader|llvmpipe|software|basic render/i.test(name);
}

function makeGround() {
  const shadow = new Mesh(new PlaneGeometry(40, 40), new ShadowMaterial({ opacity: 0.2, color: new Color(0x14303a) }));
  const grid = new Mesh(
    new PlaneGeometry(40, 40),
    new ShaderMaterial({
      transparent: true,
      depthWrite: false,
      uniforms: { cell: { value: 0.25 } },
      vertexShader: `varying vec2 at;
        void main() { at = position.xy; gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0); }`,
      fragmentShader: `varying vec2 at; uniform float cell;
        float lines(float size) {
          vec2 place = at / size;
          vec2 away = abs(fract(place - 0.5) - 0.5) / max(fwidth(place), vec2(1e-6));
          return 1.0 - min(min(away.x, away.y), 1.0);
        }
        void main() {
          float fade = 1.0 - smoothstep(1.2, 6.0, length(at));
          float strength = max(0.16 * lines(cell), 0.34 * lines(5.0 * cell));
          gl_FragColor = vec4(vec3(0.22, 0.34, 0.40), strength * fade);
        }`,
    }),
  );
  for (const plane of [shadow, grid]) plane.rotation.x = -Math.PI / 2;
  shadow.position.y = -0.012;
  grid.position.y = -0.011;
  shadow.receiveShadow = true;
  grid.renderOrder = -1;
  return { shadow, grid };
}
