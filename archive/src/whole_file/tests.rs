use super::*;

/// Serialises the tests that write, because the set of unfinished files is global.
static WRITING: Mutex<()> = Mutex::new(());

#[test]
fn a_file_that_is_there_stays_unless_it_is_to_be_replaced() {
    let _alone = WRITING.lock().unwrap_or_else(PoisonError::into_inner);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("new/twin.yaml");
    write(&path, "old", Existing::Keep).unwrap();
    let refused = write(&path, "new", Existing::Keep).unwrap_err();
    assert_eq!(refused.kind(), io::ErrorKind::AlreadyExists);
    assert_eq!(fs::read_to_string(&path).unwrap(), "old");
    write(&path, "new", Existing::Replace).unwrap();
    assert_eq!(fs::read_to_string(&path).unwrap(), "new");
    assert!(!part_of(&path).exists(), "nothing unfinished stays");
}

#[test]
fn what_is_unfinished_is_removed_and_what_is_whole_stays() {
    let _alone = WRITING.lock().unwrap_or_else(PoisonError::into_inner);
    let folder = tempfile::tempdir().unwrap();
    let (whole, torn) = (
        folder.path().join("a.json"),
        folder.path().join("b.mcap.part"),
    );
    write(&whole, "all", Existing::Keep).unwrap();
    create_new(&torn).unwrap();
    fs::write(&torn, "hal").unwrap();
    remove_unfinished();
    assert!(whole.exists() && !torn.exists());
}

fn create_new(part: &Path) -> io::Result<File> {
    create(part, OpenOptions::new().write(true).create_new(true))
}

#[test]
fn nobody_begins_a_file_while_the_program_leaves() {
    let _alone = WRITING.lock().unwrap_or_else(PoisonError::into_inner);
    let folder = tempfile::tempdir().unwrap();
    let (torn, late) = (
        folder.path().join("a.mcap.part"),
        folder.path().join("b.mcap.part"),
    );
    create_new(&torn).unwrap();
    let leaving = remove_unfinished_and_leave();
    let begun = {
        let late = late.clone();
        std::thread::spawn(move || create_new(&late).map(|_| ()))
    };
    std::thread::sleep(std::time::Duration::from_millis(50));
    assert!(!torn.exists() && !late.exists());
    drop(leaving);
    begun.join().unwrap().unwrap();
    assert!(late.exists());
    remove_unfinished();
}

#[test]
fn a_file_that_is_there_already_is_none_of_ours() {
    let _alone = WRITING.lock().unwrap_or_else(PoisonError::into_inner);
    let folder = tempfile::tempdir().unwrap();
    let other = folder.path().join("a.mcap.part");
    fs::write(&other, "another's").unwrap();
    let refused = create_new(&other).unwrap_err();
    assert_eq!(refused.kind(), io::ErrorKind::AlreadyExists);
    remove_unfinished();
    assert!(other.exists());
}

#[test]
fn a_part_whose_writer_lives_is_not_moved_out_of_the_way() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let part = File::create(part_of(&path)).unwrap();
    hold(&part).unwrap();
    let refused = set_part_aside(&path).unwrap_err();
    assert_eq!(refused.kind(), io::ErrorKind::ResourceBusy);
    drop(part);
    let aside = set_part_aside(&path).unwrap().unwrap();
    assert_eq!(aside, folder.path().join("a.1.mcap.part"));
}

#[test]
fn the_room_of_a_folder_that_is_not_there_yet_is_that_of_the_one_above_it() {
    let _alone = WRITING.lock().unwrap_or_else(PoisonError::into_inner);
    let folder = tempfile::tempdir().unwrap();
    let below = folder.path().join("not/there/yet");
    assert!(free_bytes(&below).unwrap() > 0);
    create_folder(&below).unwrap();
    assert!(below.is_dir());
}

#[test]
fn an_unused_name_is_the_first_that_no_file_has() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    assert_eq!(unused_name(&path).unwrap(), path);
    for name in ["a.mcap", "a.1.mcap"] {
        File::create(folder.path().join(name)).unwrap();
    }
    assert_eq!(unused_name(&path).unwrap(), folder.path().join("a.2.mcap"));
}
