"""Phrases of several things: what is understood, and where the things stand."""

import itertools
import math

import pytest
import torch

from diff3ds.bezier import evaluate
from diff3ds.library.categories import CATEGORIES
from diff3ds.library.layout import LEAN, LEAST, arranged, arranged_solids
from diff3ds.library.members import member
from diff3ds.library.phrase import is_slip, parse
from diff3ds.library.scene import parse_scene
from diff3ds.library.wording import understood_scene, wording_that_works

READ = {
    "a chair": ("1 chair", ""),
    "two chairs": ("2 chair", ""),
    "a chair with armrests and a high back": ("1 chair", ""),
    "a table with a lamp on it and two chairs": ("1 table, 1 lamp, 2 chair", "1 on 0; 2 beside 0"),
    "a mug that is standing on a round table": ("1 mug, 1 table", "0 on 1"),
    "a teapot and three mugs on a table": ("1 teapot, 3 mug, 1 table", "0 on 2; 1 on 2"),
    "a candle, a mug and a teapot on a table": ("1 candle, 1 mug, 1 teapot, 1 table", "0 on 3; 1 on 3; 2 on 3"),
    "a sofa and a lamp on a table": ("1 sofa, 1 lamp, 1 table", "1 on 2"),
    "a sofa and a lamp": ("1 sofa, 1 lamp", "1 beside 0"),
    "a wine glass on a table with two chairs around it": ("1 wine glass, 1 table, 2 chair", "0 on 1; 2 around 1"),
    "a bookshelf behind a sofa and a table in front of the sofa": (
        "1 bookshelf, 1 sofa, 1 table",
        "0 behind 1; 2 in front of 1",
    ),
    "a house between a tree and a windmill": ("1 house, 1 tree, 1 windmill", "0 between 1 2"),
    "a church between two trees": ("1 church, 2 tree", "0 between 1"),
    "a small table to the left of a bed": ("1 table, 1 bed", "0 left of 1"),
    "a lamp on a table between two chairs": ("1 lamp, 1 table, 2 chair", "1 between 2; 0 on 1"),
    "two cups of coffee on a kitchen table": ("2 mug, 1 table", "0 on 1"),
    "two hot air balloons flying above a house": ("2 hot-air balloon, 1 house", "0 above 1"),
    "a sofa with a lamp on the left and a plant on the right": (
        "1 sofa, 1 lamp, 1 flower",
        "1 left of 0; 2 right of 0",
    ),
    "a table with a candle, a bottle and two chairs": (
        "1 table, 1 candle, 1 bottle, 2 chair",
        "1 on 0; 2 on 0; 3 beside 0",
    ),
    "a ladder leaning against the house": ("1 ladder, 1 house", "0 against 1"),
    "an old windmill and some flowers": ("1 windmill, 3 flower", "1 beside 0"),
    "A sketch of a fish underneath a boat.": ("1 fish, 1 sailing boat", "0 under 1"),
    "a cute cat sleeping on the sofa": ("1 cat, 1 sofa", "0 on 1"),
    "a dog under the table": ("1 dog, 1 table", "0 under 1"),
    "a castle with a dragon behind it": ("1 castle, 1 dragon", "1 behind 0"),
    "a small orange fish in a bowl": ("1 fish, 1 bowl", "0 in 1"),
    "two apples inside a bowl on a table": ("2 apple, 1 bowl, 1 table", "1 on 2; 0 in 1"),
    "a spider hanging from a tree": ("1 spider, 1 tree", "0 under 1"),
    "a table with a lamp on top": ("1 table, 1 lamp", "1 on 0"),
    "a cupcake with a cherry on top": ("1 cupcake", ""),
    "a dragon fighting a knight": ("1 dragon, 1 person", "0 beside 1"),
    "a football player kicking a ball": ("1 person, 1 ball", "0 behind 1"),
    "a princess riding on a unicorn": ("1 person, 1 horse", "0 on 1"),
    "a tent in the forest with a campfire": ("1 tent, 1 campfire", "1 beside 0"),
    "my mum and my dad holding hands": ("1 person, 1 person", "1 beside 0"),
    "a duck with a hat": ("1 duck, 1 hat", "1 on 0"),
    "a king with a crown on a chair": ("1 person, 1 crown, 1 chair", "0 on 2; 1 on 0"),
    "the sun and a tree": ("1 sun, 1 tree", "0 beside 1"),
    "my teacher at her desk": ("1 person, 1 table", "0 behind 1"),
    "a bicycle leaning against a wall": ("1 bicycle", ""),
    "a girl in a dress": ("1 person", ""),
    "a boy holding a balloon": ("1 person, 1 hot-air balloon", "1 beside 0"),
}


@pytest.mark.parametrize("phrase", READ)
def test_what_is_read(phrase) -> None:
    scene = parse_scene(phrase)
    things = ", ".join(f"{thing.count} {thing.request.category}" for thing in scene.things)
    relations = "; ".join(f"{r.thing} {r.kind} {' '.join(map(str, r.targets))}" for r in scene.relations)
    assert (things, relations) == READ[phrase]
    assert all(thing.request.count == 1 for thing in scene.things)


REFUSED = {
    "a table with a lamp on": "something is missing at its end",
    "a chair and": "something is missing at its end",
    "a zeppelin on a table": "'a zeppelin': the built-in prior does not know 'zeppelin'",
    "a tent in the forest with a zeppelin": "the built-in prior does not know 'with a zeppelin'",
    "a table with a zeppelin on it": "'a zeppelin': the built-in prior does not know 'zeppelin'",
    "a chair with wheels": "what it knows of a chair",
    "a chair between a table": "between what",
    "ten chairs around a table": "'ten chairs'",
    "six chairs around a table beside six trees": "at most 12 things",
    "a mug on a table and a chair beside the mug on a bed": "'a mug' has two places: say one",
    "a chair under the chair": "would stand on or beside themselves",
    "a chair on the table on the chair": "would stand on or beside themselves",
    "": "the phrase is empty",
}


@pytest.mark.parametrize("phrase", REFUSED)
def test_what_is_refused(phrase) -> None:
    with pytest.raises(ValueError, match=REFUSED[phrase]):
        parse_scene(phrase)


@pytest.mark.parametrize(
    ("phrase", "category", "unseen"),
    [
        ("3 cactuses in the desert", "cactus", ("in the desert",)),
        ("a rocket going to the moon", "rocket", ("to the moon",)),
        ("my bedroom with a bed and a lamp", "bed", ("bedroom",)),
        ("a really big blue rocket with 3 windows", "rocket", ("really", "big", "3")),
        ("a pirate sword", "sword", ("pirate",)),
        ("a clock that says 3 o'clock", "clock", ("that says 3 o clock",)),
        ("a unicorn with a long rainbow tail", "horse", ("rainbow", "long rainbow tail")),
        ("a house with a tiny door", "house", ("tiny door",)),
    ],
)
def test_what_is_not_drawn_is_told(phrase, category, unseen) -> None:
    request = parse_scene(phrase).things[0].request
    assert (request.category, request.ignored, request.corrected) == (category, unseen, ())


def placed(phrase: str) -> list[list[torch.Tensor]]:
    """Low and high corners of each thing's copies, of those in the ball."""
    scene = parse_scene(phrase)
    generator = torch.Generator().manual_seed(0)
    sketches = [member(t.request.category, generator, t.request.attributes).sketch for t in scene.things]
    whole = arranged(scene, sketches)
    points = evaluate(whole.points, whole.weights, torch.linspace(0, 1, 65))
    assert points.norm(dim=-1).max() == pytest.approx(0.95, abs=1e-3)
    order = []
    # `arranged` concatenates copies thing by thing.
    start = 0
    for thing, sketch in zip(scene.things, sketches, strict=True):
        boxes = []
        for _ in range(thing.count):
            own = points[start : start + len(sketch)].reshape(-1, 3)
            boxes.append(torch.stack([own.amin(0), own.amax(0)]))
            start += len(sketch)
        order.append(boxes)
    assert start == len(whole)
    return order


def test_what_stands_on_a_table_stands_on_its_top() -> None:
    (table,), (lamp,) = placed("a table with a lamp on it")
    assert lamp[0, 2] == pytest.approx(float(table[1, 2]), abs=1e-3)
    assert (table[0, :2] < lamp[0, :2]).all()
    assert (lamp[1, :2] < table[1, :2]).all()
    sizes = [(box[1] - box[0]).max() for box in (table, lamp)]
    wanted = CATEGORIES["table"].metres / CATEGORIES["lamp"].metres
    assert sizes[0] / sizes[1] == pytest.approx(wanted, rel=0.01)


def test_what_stands_on_a_chair_stands_on_its_seat() -> None:
    (book,), (chair,) = placed("a teapot on a chair")
    height = chair[1, 2] - chair[0, 2]
    assert float((book[0, 2] - chair[0, 2]) / height) == pytest.approx(CATEGORIES["chair"].carries, abs=1e-3)


@pytest.mark.parametrize(("small", "large"), [("fish", "bowl"), ("elephant", "house"), ("teddy bear", "bed")])
def test_what_is_in_something_is_no_wider_and_stands_on_its_floor(small, large) -> None:
    (one,), (target,) = placed(f"a {small} in a {large}")
    assert (one[0, :2] > target[0, :2]).all()
    assert (one[1, :2] < target[1, :2]).all()
    carries = CATEGORIES[large].carries
    floor = 0 if carries == 1 else carries * (target[1, 2] - target[0, 2])
    assert float(one[0, 2] - target[0, 2]) == pytest.approx(float(floor), abs=1e-3)
    assert carries < 1 or one[1, 2] < target[1, 2]


def test_things_on_one_table_do_not_overlap() -> None:
    (one,), mugs, (table,) = placed("a teapot and three mugs on a table")
    row = sorted([one, *mugs], key=lambda box: float(box[0, 1]))
    assert all(left[1, 1] < right[0, 1] for left, right in itertools.pairwise(row))
    assert all(box[0, 2] == pytest.approx(float(table[1, 2]), abs=1e-3) for box in row)


@pytest.mark.parametrize(
    ("relation", "axis", "sign"),
    [("in front of", 0, 1), ("behind", 0, -1), ("to the right of", 1, 1), ("to the left of", 1, -1)],
)
def test_sides(relation, axis, sign) -> None:
    (car,), (house,) = placed(f"a car {relation} a house")
    near, far = (car[0, axis], house[1, axis]) if sign > 0 else (house[0, axis], car[1, axis])
    assert near > far
    # On one ground, and in the middle of the other direction.
    assert car[0, 2] == pytest.approx(float(house[0, 2]), abs=1e-3)
    assert car[:, 1 - axis].mean() == pytest.approx(float(house[:, 1 - axis].mean()), abs=1e-3)


def test_between_around_under_and_beside() -> None:
    (church,), trees = placed("a church between two trees")
    left, right = sorted(trees, key=lambda box: float(box[0, 1]))
    assert left[1, 1] < church[0, 1]
    assert church[1, 1] < right[0, 1]
    chairs, (table,) = placed("four chairs around a round table")
    middles = torch.stack([box.mean(0) for box in chairs]) - table.mean(0)
    assert [(float(m[1]) > 0.1, float(m[0]) < -0.1) for m in middles[:2]] == [(True, False), (False, True)]
    balloons, (house,) = placed("two hot air balloons above a house")
    assert all(balloon[0, 2] > house[1, 2] for balloon in balloons)
    (fish,), (boat,) = placed("a fish under a boat")
    assert fish[1, 2] < boat[0, 2]
    (mug,), (table,) = placed("a mug under a table")
    assert table[0, 2] == pytest.approx(float(mug[0, 2]), abs=1e-3)
    assert mug[1, 2] < table[1, 2]
    boxes = [box for thing in placed("a table, a bed and two chairs") for box in thing]
    row = sorted(boxes, key=lambda box: float(box[0, 1]))
    assert all(one[1, 1] < other[0, 1] for one, other in itertools.pairwise(row))


def test_beside_and_around_what_stands_on_a_table_is_on_the_table() -> None:
    (mug,), (teapot,), (table,) = placed("a mug beside a teapot on a table")
    assert [box[0, 2] for box in (mug, teapot)] == pytest.approx([float(table[1, 2])] * 2, abs=1e-3)
    assert mug[0, 1] > teapot[1, 1]
    mugs, _, (table,) = placed("three mugs around a teapot on a table")
    assert all(mug[0, 2] == pytest.approx(float(table[1, 2]), abs=1e-3) for mug in mugs)
    (sofa,), _, _ = placed("a sofa beside a lamp on a table")
    assert sofa[0, 2] < 0


def test_small_things_are_seen_and_said_sizes_count() -> None:
    (bicycle,), (church,) = placed("a bicycle beside a church")
    sizes = [float((box[1] - box[0]).max()) for box in (bicycle, church)]
    assert sizes[0] / sizes[1] == pytest.approx(LEAST, rel=0.01)
    (big,), (small,) = placed("a big chair and a small chair")
    ratio = float((big[1] - big[0]).max() / (small[1] - small[0]).max())
    assert ratio == pytest.approx(1.3 / 0.75, rel=0.01)


@pytest.mark.parametrize(
    ("word", "known", "slip"),
    [
        ("chiar", "chair", True),
        ("umbrela", "umbrella", True),
        ("ladder", "lader", True),
        ("windmil", "windmill", True),
        ("bicyle", "bicycle", True),
        ("bycicle", "bicycle", True),
        ("horse", "house", False),
        ("hose", "house", False),
        ("bride", "bridge", False),
        ("cable", "table", False),
        ("castle", "candle", False),
        ("bow", "bwo", False),
        ("chair", "chair", False),
    ],
)
def test_slips_of_the_pen(word, known, slip) -> None:
    assert is_slip(word, known) is slip


def test_misspelt_and_unseen_words_are_taken_and_told() -> None:
    request = parse("two old wooden chiars with armrsets")
    assert (request.category, request.count, request.attributes) == ("chair", 2, ("armrests",))
    assert request.ignored == ("old", "wooden")
    assert dict(request.corrected) == {"chiars": "chairs", "armrsets": "armrests"}
    assert parse("a glass bottle").category == "bottle"
    assert parse("a steaming cup of tea").attributes == ("steam",)


def test_chairs_around_a_table_face_it() -> None:
    scene = parse_scene("two chairs around a table")
    generator = torch.Generator().manual_seed(0)
    chair, table = (member(thing.request.category, generator).sketch for thing in scene.things)
    whole = arranged(scene, [chair, table])
    count = len(chair)
    middle = whole[2 * count :].points.reshape(-1, 3).mean(0)
    for copy in (whole[:count], whole[count : 2 * count]):
        points = copy.points.reshape(-1, 3) - middle
        # The backs are the highest parts.
        back = points[points[:, 2] > points[:, 2].max() - 0.02]
        center = points[:, :2].mean(0)
        outward = center / center.norm()
        assert back[:, :2].mean(0) @ outward > center @ outward + 0.02


@pytest.mark.parametrize(
    ("phrase", "each"),
    [
        ("an old wooden table with two red chairs", ["an old wooden table", "a red chair"]),
        ("three snowmen and a dog", ["a snowman", "a dog"]),
        ("two pairs of scissors on a table", ["a pair of scissors", "a table"]),
        ("four big chairs with armrests and two apples", ["a big chair with armrests", "an apple"]),
    ],
)
def test_each_of_several_is_said_in_words_of_its_own(phrase, each):
    assert [thing.one for thing in parse_scene(phrase).things] == each


def test_a_hat_is_on_the_head_and_as_wide_as_that_asks_for() -> None:
    (duck,), (hat,) = placed("a duck with a hat")
    length, height, wide = CATEGORIES["duck"].head
    size = duck[1] - duck[0]
    assert hat[:, 0].mean() == pytest.approx(float(duck[0, 0] + length * size[0]), abs=1e-3)
    assert hat[0, 2] == pytest.approx(float(duck[0, 2] + height * size[2]), abs=1e-3)
    worn = CATEGORIES["hat"].worn * wide * size[2]
    assert hat[1, 1] - hat[0, 1] == pytest.approx(float(worn), rel=0.01)


def test_the_sun_is_in_the_sky_and_no_larger_than_what_stands() -> None:
    for phrase in ("the sun and a snowman", "a snowman and the sun", "a snowman to the left of the sun"):
        first, second = (boxes[0] for boxes in placed(phrase))
        sun, snowman = (first, second) if phrase.startswith("the sun") else (second, first)
        assert sun[0, 2] == pytest.approx(float(snowman[1, 2]), abs=1e-3)
        assert (sun[1] - sun[0]).max() == pytest.approx(float((snowman[1] - snowman[0]).max()), rel=0.01)
    # Who is in it is on the ground with it.
    (boy,), (helicopter,), (house,) = placed("a boy in a helicopter beside a house")
    assert helicopter[0, 2] == pytest.approx(float(house[0, 2]), abs=1e-3)
    assert boy[1, 2] <= helicopter[1, 2] + 1e-3


def test_a_ladder_leans_on_what_it_is_beside() -> None:
    for phrase in ("a ladder and a house", "a house with a ladder", "a ladder against a house"):
        scene = parse_scene(phrase)
        sketches = [member(t.request.category, torch.Generator().manual_seed(0)).sketch for t in scene.things]
        first = 0 if phrase.startswith("a ladder") else 1
        whole, start = arranged(scene, sketches), [0, len(sketches[0])][first]
        ladder = whole[start : start + len(sketches[first])]
        house = whole[len(sketches[0]) :] if first == 0 else whole[: len(sketches[0])]
        rail = ladder.points[0, -1] - ladder.points[0, 0]
        upright = float(rail[2].abs() / rail.norm())
        assert upright == pytest.approx(math.cos(math.radians(LEAN)), abs=0.02)
        # Its top is at the wall, its foot is not.
        points, wall = ladder.points.reshape(-1, 3), house.points.reshape(-1, 3)[:, 1].max()
        assert points[:, 1].min() == pytest.approx(float(wall), abs=2e-3)
        assert points[points[:, 2].argmax(), 1] < points[points[:, 2].argmin(), 1]
    (car,), (house,) = placed("a car against a house")
    assert car[0, 2] == pytest.approx(float(house[0, 2]), abs=1e-3)


@pytest.mark.parametrize("phrase", ["a chair beside a table", "a table and two chairs", "a table between two chairs"])
def test_chairs_beside_a_table_face_it(phrase) -> None:
    scene = parse_scene(phrase)
    sketches = [member(t.request.category, torch.Generator().manual_seed(0)).sketch for t in scene.things]
    whole = arranged(scene, sketches)
    names = [name.split("/")[0] for name in whole.names]
    table = whole.points[[i for i, name in enumerate(names) if name == "table"]].reshape(-1, 3).mean(0)
    for chair in {*names} - {"table"}:
        points = whole.points[[i for i, name in enumerate(names) if name == chair]].reshape(-1, 3) - table
        back = points[points[:, 2] > points[:, 2].max() - 0.02]
        assert abs(float(back[:, 1].mean())) > abs(float(points[:, 1].mean())) + 0.02


@pytest.mark.parametrize(
    ("phrase", "instead"),
    [
        ("a giraffe with a scarf", "a dinosaur"),
        ("an apple and a xylophone in a bowl", "an apple in a bowl"),
        ("a house with a chimney and smoke", "a house with a chimney"),
        ("two robots with hats", "two robots with two hats"),
        ("a bird on a branch", "a bird with a branch"),
        ("two children playing football", "two children playing"),
        ("a xylophone", ""),
        (" ".join(["very"] * 20) + " xylophone", ""),
    ],
)
def test_what_is_refused_comes_with_the_wording_that_works(phrase, instead) -> None:
    assert wording_that_works(phrase) == instead
    with pytest.raises(ValueError, match=f"Say instead: {instead}$" if instead else "does not know"):
        understood_scene(phrase)


def test_faces_stand_where_the_things_stand() -> None:
    """A box of faces around each thing lies around its strokes, wherever that is placed, as large and as turned."""
    scene = parse_scene("two chairs around a table")
    generator = torch.Generator().manual_seed(0)
    sketches = [member(thing.request.category, generator).sketch for thing in scene.things]
    ends = [sketch.points[:, [0, 1, 3]].double() for sketch in sketches]
    whole, faces = arranged_solids(scene, sketches, ends)
    torch.testing.assert_close(faces.float(), whole.points[:, [0, 1, 3]], atol=1e-5, rtol=0)
    torch.testing.assert_close(whole.points, arranged(scene, sketches).points)
