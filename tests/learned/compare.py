"""The five learned methods of Tajiri and Iwamoto written with PyTorch and scikit-learn, beside tauscope's, on one set.

    compare.py SET.yaml EVALUATED [--detectors a,b] [--seeds 5] [--keep FILE]

EVALUATED is the folder of `tauscope evaluate SET.yaml --out EVALUATED --detectors ... --twin regression --json > EVALUATED/summary.json`.
Taken from there: the twin's gains and offsets (twin.yaml) and every hyperparameter (learnt.yaml), and tauscope's own figures.
Everything else is computed here: signals (signals.py), scaling, training, scores, F1 at mean + 4 sigma of the validation scores and
ROC area. The seeds are this side's own: the two sides share data and settings, not random numbers.
"""
import argparse
import json
import os
import time

import numpy as np
import torch
import yaml
from sklearn.svm import OneClassSVM
from torch import nn

import signals

torch.set_num_threads(1)


class Scaling:
    """Equation 8: each dimension to 0..1 over the training data."""

    def __init__(self, rows):
        self.low, self.range = rows.min(0), np.ptp(rows, axis=0)

    def __call__(self, rows):
        return np.where(self.range > 0, (rows - self.low) / np.where(self.range > 0, self.range, 1), 0)

    def undo(self, rows):
        return self.low + rows * self.range


def windows(rows, length, stride=1):
    """Windows of `length` rows, each laid out flat, oldest first."""
    at = np.arange(0, len(rows) - length + 1, stride)
    return np.stack([rows[k:k + length].ravel() for k in at]) if len(at) else np.empty((0, length * rows.shape[1]))


class Vectors:
    """A model of scaled torque vectors; a vector is `window` samples."""

    def __init__(self, settings, window, fit):
        self.window, self.stride, self.fit, self.settings = window, settings.get("stride", 1), fit, settings

    def train(self, recordings, seed):
        rows = np.vstack([windows(r.torque[r.settled], self.window, self.stride) for r in recordings])
        self.scaling = Scaling(rows)
        self.score = self.fit(self.scaling(rows), self.settings, seed)

    def scores(self, r):
        """Score by sample; NaN where there is none."""
        out = np.full(len(r.t_s), np.nan)
        rows = windows(r.torque[r.settled], self.window)
        out[np.flatnonzero(r.settled)[self.window - 1:]] = self.score(self.scaling(rows))
        return out


def one_class(rows, settings, _seed):
    machine = OneClassSVM(kernel="rbf", gamma="scale", nu=settings["nu"], cache_size=1000).fit(rows)
    return lambda x: -machine.decision_function(x)


def steps(settings, parameters, batches, loss):
    """Adam over `epochs`; `batches` gives those of one epoch."""
    adam = torch.optim.Adam(parameters, lr=settings["learning_rate"])
    for _ in range(settings["epochs"]):
        for batch in batches():
            adam.zero_grad()
            loss(batch).backward()
            adam.step()


def autoencoder(rows, settings, seed):
    torch.manual_seed(seed)
    training = settings["training"]
    sizes = [rows.shape[1], *settings["layers"], rows.shape[1]]
    layers = []
    for a, b in zip(sizes[:-2], sizes[1:-1]):
        layers += [nn.Linear(a, b), nn.ReLU(), nn.Dropout(training["dropout"])]
    net = nn.Sequential(*layers, nn.Linear(sizes[-2], sizes[-1]))
    x = torch.tensor(rows, dtype=torch.float32)
    steps(training, net.parameters(), lambda: torch.randperm(len(x)).split(training["batch"]),
          lambda batch: nn.functional.mse_loss(net(x[batch]), x[batch]))
    net.eval()

    def score(x):
        with torch.no_grad():
            return ((net(torch.tensor(x, dtype=torch.float32)).numpy() - x)**2).mean(1)
    return score


class Lstm:
    """External torque of a contact-free arm from its motion; the score is what it leaves, squared [(N m)^2]."""

    def __init__(self, settings):
        self.settings, self.window = settings, settings["sequence"]

    def train(self, recordings, seed):
        torch.manual_seed(seed)
        rng, length, training = np.random.default_rng(seed), self.window, self.settings["training"]
        motion, torque = ([getattr(r, "torque") if of is None else of(r) for r in recordings] for of in (signals.Signals.motion, None))
        keep = [r.settled for r in recordings]
        motion, torque = [m[k] for m, k in zip(motion, keep)], [t[k] for t, k in zip(torque, keep)]
        self.inputs, self.outputs = Scaling(np.vstack(motion)), Scaling(np.vstack(torque))
        x = [torch.tensor(self.inputs(m), dtype=torch.float32) for m in motion]
        y = [torch.tensor(self.outputs(t), dtype=torch.float32) for t in torque]
        joints = torque[0].shape[1]
        self.net = nn.LSTM(3 * joints, self.settings["hidden"], batch_first=True)
        self.out = nn.Linear(self.settings["hidden"], joints)
        left_out = nn.Dropout(training["dropout"])

        def batches():
            """Disjoint sequences that begin elsewhere in every epoch; a batch counts samples."""
            all_ = [(i, k) for i, r in enumerate(x)
                    for k in range(rng.integers(min(length, len(r) - length + 1)), len(r) - length + 1, length)]
            rng.shuffle(all_)
            size = max(1, training["batch"] // length)
            return [all_[k:k + size] for k in range(0, len(all_), size)]

        def loss(batch):
            states, _ = self.net(torch.stack([x[i][k:k + length] for i, k in batch]))
            return nn.functional.mse_loss(self.out(left_out(states)), torch.stack([y[i][k:k + length] for i, k in batch]))

        steps(training, [*self.net.parameters(), *self.out.parameters()], batches, loss)

    def scores(self, r):
        out, at = np.full(len(r.t_s), np.nan), np.flatnonzero(r.settled)
        with torch.no_grad():
            states, _ = self.net(torch.tensor(self.inputs(r.motion()[at]), dtype=torch.float32)[None])
            expected = self.outputs.undo(self.out(states)[0].numpy().astype(float))
        out[at] = ((r.torque[at] - expected)**2).sum(1)
        out[at[:self.window - 1]] = np.nan
        return out


METHODS = {
    "point_ocsvm": lambda s: Vectors(s, 1, one_class),
    "point_autoencoder": lambda s: Vectors(s, 1, autoencoder),
    "lstm_momentum_observer": Lstm,
    "window_ocsvm": lambda s: Vectors(s, s["window"], one_class),
    "window_autoencoder": lambda s: Vectors(s, s["window"], autoencoder),
}
EXACT = ("point_ocsvm", "window_ocsvm")


def area(score, label):
    """ROC area, ties shared."""
    _, at, count = np.unique(score, return_inverse=True, return_counts=True)
    rank = (np.cumsum(count) - (count - 1) / 2)[at]
    n1, n0 = label.sum(), (~label).sum()
    return (rank[label].sum() - n1 * (n1 + 1) / 2) / (n1 * n0)


def f1(score, label, threshold):
    said = score >= threshold
    return 2 * (said & label).sum() / max(said.sum() + label.sum(), 1)


def judge(method, recordings, spec, labels):
    """ROC area and F1 over the test recordings, as `tauscope evaluate` counts them."""
    name = lambda p: os.path.splitext(os.path.basename(p))[0]
    validation = [method.scores(recordings[name(p)]) for p in spec["validation"]]
    heard = np.concatenate(validation)
    lowest, mean = np.nanmin(heard), np.nanmean(heard)
    heard = np.where(np.isnan(heard), mean, heard)
    threshold = heard.mean() + 4 * heard.std()
    score, label = [], []
    for p in spec["test"]:
        r, s = recordings[name(p)], method.scores(recordings[name(p)])
        touched, counted = np.zeros(len(s), bool), np.ones(len(s), bool)
        for e in labels["recordings"][name(p)]["events"]:
            inside = (r.t_s >= e["t_on"]) & (r.t_s <= e["t_off"])
            touched |= inside & (not e["ignore"])
            counted &= ~(inside & e["ignore"])
        counted |= touched
        score.append(np.where(np.isnan(s), lowest, s)[counted])
        label.append(touched[counted])
    score, label = np.concatenate(score), np.concatenate(label)
    return area(score, label), f1(score, label, threshold)


def spread(values):
    if not values:
        return "-"
    return f"{np.mean(values):.3f}" + (f" ± {np.std(values):.3f}" if len(values) > 1 else "")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("set")
    parser.add_argument("evaluated")
    parser.add_argument("--detectors", default=",".join(METHODS))
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--keep", help="a file of this side's figures: what is in it is not computed anew")
    args = parser.parse_args()
    spec = yaml.safe_load(open(args.set))
    read = lambda name: yaml.safe_load(open(os.path.join(args.evaluated, name)))
    twin, learnt = read("twin.yaml"), read("learnt.yaml")
    summary = os.path.join(args.evaluated, "summary.json")
    own = {d["detector"]: [(s["samples"]["auc"], s["samples"]["f1"]) for s in d["seeds"]]
           for d in (json.load(open(summary))["detectors"] if os.path.exists(summary) else [])}
    kept = json.load(open(args.keep)) if args.keep and os.path.exists(args.keep) else {}
    labels = json.load(open(os.path.join(os.path.dirname(args.set), spec["labels"])))
    for p in spec["train"] + spec["validation"]:
        if labels["recordings"][os.path.splitext(os.path.basename(p))[0]]["events"]:
            raise SystemExit(f"{p} holds contacts: this script trains and thresholds on whole recordings")
    recordings = signals.load(args.set, spec, twin)
    train = [recordings[os.path.splitext(os.path.basename(p))[0]] for p in spec["train"]]
    print(f"{sum(r.settled.sum() for r in train)} training samples", flush=True)
    print("| | ROC area, tauscope | ROC area, reference | F1, tauscope | F1, reference | training, reference [s] |\n" + "| --- " * 6 + "|")
    for name in args.detectors.split(","):
        seeds = kept.setdefault(name, [])
        for seed in range(len(seeds), 1 if name in EXACT else args.seeds):
            method, began = METHODS[name](learnt[name][name]), time.time()
            method.train(train, seed)
            took = time.time() - began
            area_, f1_ = judge(method, recordings, spec, labels)
            seeds.append(dict(auc=float(area_), f1=float(f1_), training_s=took))
            if args.keep:
                json.dump(kept, open(args.keep, "w"), indent=1)
        ours = own.get(name, [])
        cells = [spread([s[0] for s in ours]), spread([s["auc"] for s in seeds]), spread([s[1] for s in ours]),
                 spread([s["f1"] for s in seeds]), f"{np.mean([s['training_s'] for s in seeds]):.1f}"]
        print(f"| `{name}` | " + " | ".join(cells) + " |", flush=True)


main()
